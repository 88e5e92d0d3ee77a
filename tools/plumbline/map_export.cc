// plumbline map export: a map's lines as PLY or OBJ.
#include "plumb/map/map_export.h"

#include <cstdint>
#include <string>

#include "plumb/map/map_file.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct ExportOptions {
  std::string map, out, format;
  uint32_t min_observing = 0;
  bool json = false;
};

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

Outcome RunMapExport(const ExportOptions& options) {
  MapExportOptions export_options;
  export_options.min_observing = options.min_observing;
  if (options.format == "obj" || (options.format.empty() && EndsWith(options.out, ".obj"))) {
    export_options.format = MapExportFormat::kObj;
  } else if (options.format.empty() && !EndsWith(options.out, ".ply")) {
    return Failure{kExitUsage,
                   "--out " + options.out + ": ends neither in .ply nor in .obj; say --format"};
  }
  const Result<LineMap> map = ReadMap(options.map);
  if (!map) return FailureFrom(map.error());
  if (const Status written = ExportLines(*map, options.out, export_options); !written) {
    return FailureToWrite(written.error());
  }
  size_t num_lines = 0;
  for (const MapLine& line : map->lines) {
    if (line.num_observing >= options.min_observing) ++num_lines;
  }
  if (!options.json) return PrintText(options.out + ": " + std::to_string(num_lines) + " lines\n");
  Json report = NewReport("map_export");
  report["file"] = options.out;
  report["format"] = export_options.format == MapExportFormat::kObj ? "obj" : "ply";
  report["lines"] = num_lines;
  return PrintJson(report);
}

}  // namespace

void AddMapExport(CLI::App& map, PendingRun& pending) {
  AddCommand<ExportOptions>(
      map, pending, "export", "Write a map's lines as PLY or OBJ",
      [](CLI::App& command, ExportOptions& options) {
        command.add_option("map,--map", options.map, "Directory of the map")->required();
        command.add_option("--out", options.out, "File to write")->required();
        command
            .add_option("--format", options.format, "ply or obj (default: by the file's ending)")
            ->check(CLI::IsMember({"ply", "obj"}));
        command.add_option("--min-observing", options.min_observing,
                           "Leave out lines that fewer key frames observed");
        command.add_flag("--json", options.json, "Print what was written as JSON");
        command.footer(
            "Examples:\n"
            "  plumbline map export office.map --out office.ply\n"
            "  plumbline map export office.map --out office.obj --min-observing 2");
      },
      RunMapExport);
}

}  // namespace plumb::tools
