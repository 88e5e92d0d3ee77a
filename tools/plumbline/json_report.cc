// JSON documents that the program prints and writes.
#include "tools/plumbline/json_report.h"

#include <cmath>

#include "tools/plumbline/console.h"

namespace plumb::tools {

Json NewReport(const std::string& kind) {
  return Json{{"schema", "plumb." + kind + "/1"}, {"version", PLUMB_VERSION}};
}

double Rounded(double value, int decimals) {
  const double scale = std::pow(10.0, decimals);
  return std::round(value * scale) / scale;
}

std::string ToJsonText(const Json& json, JsonLayout layout) {
  const int indent = layout == JsonLayout::kCompact ? -1 : 1;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

Outcome PrintJson(const Json& json, JsonLayout layout) {
  return PrintText(ToJsonText(json, layout));
}

Outcome PrintText(const std::string& text) {
  if (!PrintData(text)) return Failure{kExitIo, "stdout: could not be written completely"};
  return std::nullopt;
}

}  // namespace plumb::tools
