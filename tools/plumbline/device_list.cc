// plumbline device list: the compute devices that --device can name.
#include <cstdio>
#include <string>
#include <vector>

#include "plumb/gpu/device.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct DeviceListOptions {
  bool json = false;
};

std::string VersionText(uint32_t api_version) {
  char text[40];
  std::snprintf(text, sizeof(text), "%u.%u.%u", (api_version >> 22) & 0x7f,
                (api_version >> 12) & 0x3ff, api_version & 0xfff);
  return text;
}

Json ToJson(const gpu::DeviceInfo& info) {
  Json device{{"index", info.index},
              {"name", info.name},
              {"type", gpu::ToString(info.type)},
              {"software", info.IsSoftware()},
              {"driver", info.driver_name},
              {"driver_info", info.driver_info},
              {"vulkan", VersionText(info.api_version)},
              {"subgroup_size", info.subgroup_size},
              {"max_workgroup_invocations", info.limits.max_workgroup_invocations},
              {"usable", info.unusable_because.empty()}};
  if (!info.unusable_because.empty()) device["unusable_because"] = info.unusable_because;
  return device;
}

Outcome RunDeviceList(const DeviceListOptions& options) {
  const Result<std::vector<gpu::DeviceInfo>> devices = gpu::ListDevices();
  if (!devices) return Failure{kExitNoDevice, devices.error().message};
  const Result<size_t> chosen = gpu::SelectDevice(*devices, "auto");
  if (options.json) {
    Json report = NewReport("device_list");
    report["devices"] = Json::array();
    for (const gpu::DeviceInfo& info : *devices) report["devices"].push_back(ToJson(info));
    report["auto"] = chosen ? Json((*devices)[*chosen].index) : Json();
    return PrintJson(report);
  }
  if (devices->empty()) return PrintText("no Vulkan device\n");
  std::string text;
  for (const gpu::DeviceInfo& info : *devices) {
    text += std::to_string(info.index) + "  " + gpu::Describe(info);
    if (!info.unusable_because.empty()) text += " (unusable: " + info.unusable_because + ")";
    if (chosen && info.index == (*devices)[*chosen].index) text += " [auto]";
    text += "\n";
  }
  return PrintText(text);
}

}  // namespace

void AddDeviceList(CLI::App& device, PendingRun& pending) {
  AddCommand<DeviceListOptions>(
      device, pending, "list", "List the compute devices",
      [](CLI::App& command, DeviceListOptions& options) {
        command.add_flag("--json", options.json, "Print JSON");
        command.footer("Example:\n  plumbline device list --json");
      },
      RunDeviceList);
}

}  // namespace plumb::tools
