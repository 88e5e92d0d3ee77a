// Which of the listed devices a selector means.
#include <algorithm>
#include <cctype>
#include <charconv>
#include <string_view>

#include "plumb/gpu/device.h"

namespace plumb::gpu {
namespace {

int AutoRank(DeviceType type) {
  switch (type) {
    case DeviceType::kDiscrete:
      return 0;
    case DeviceType::kIntegrated:
      return 1;
    case DeviceType::kVirtual:
      return 2;
    case DeviceType::kCpu:
      return 3;
    case DeviceType::kOther:
      return 4;
  }
  return 4;
}

std::string Lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

bool IsNumber(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
}

std::string Choices(const std::vector<DeviceInfo>& devices) {
  if (devices.empty()) return "there is no Vulkan device";
  std::string text = "the devices are ";
  for (size_t i = 0; i < devices.size(); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(i) + ": " + devices[i].name;
    if (!devices[i].unusable_because.empty()) text += " (" + devices[i].unusable_because + ")";
  }
  return text;
}

}  // namespace

Result<size_t> SelectDevice(const std::vector<DeviceInfo>& devices, const std::string& selector) {
  const auto fail = [&](ErrorCode code, const std::string& what) {
    return Error{code, "device '" + selector + "' " + what + "; " + Choices(devices)};
  };
  if (selector.empty()) return fail(ErrorCode::kInvalidArgument, "names nothing");

  if (IsNumber(selector)) {
    size_t index = 0;
    const auto parsed = std::from_chars(selector.data(), selector.data() + selector.size(), index);
    if (parsed.ec != std::errc() || index >= devices.size()) {
      return fail(ErrorCode::kNotFound, "is not an index below " + std::to_string(devices.size()));
    }
    if (!devices[index].unusable_because.empty()) {
      return fail(ErrorCode::kUnsupported, "cannot be used");
    }
    return index;
  }

  const bool is_auto = selector == "auto", is_cpu = selector == "cpu";
  const std::string wanted = Lower(selector);
  size_t best = devices.size();
  for (size_t i = 0; i < devices.size(); ++i) {
    if (!devices[i].unusable_because.empty()) continue;
    if (is_cpu && devices[i].type != DeviceType::kCpu) continue;
    if (!is_auto && !is_cpu && Lower(devices[i].name).find(wanted) == std::string::npos) continue;
    if (best == devices.size() || AutoRank(devices[i].type) < AutoRank(devices[best].type)) {
      best = i;
    }
  }
  if (best == devices.size()) return fail(ErrorCode::kNotFound, "matches no usable device");
  return best;
}

}  // namespace plumb::gpu
