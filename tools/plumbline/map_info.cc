// plumbline map info: what a map holds.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>
#include <system_error>
#include <vector>

#include "plumb/map/map_file.h"
#include "plumb/runtime/camera_calibration.h"
#include "tools/metrics/percentile.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct MapInfoOptions {
  std::string map;
  bool json = false;
};

uintmax_t BytesOnDisk(const std::string& directory) {
  uintmax_t bytes = 0;
  std::error_code code;
  for (auto entry = std::filesystem::recursive_directory_iterator(directory, code);
       !code && entry != std::filesystem::recursive_directory_iterator(); entry.increment(code)) {
    if (entry->is_regular_file(code)) bytes += entry->file_size(code);
  }
  return bytes;
}

Json Describe(const std::string& path, const LineMap& map) {
  size_t num_multi_view = 0, num_segments = 0, num_points = 0;
  double length_m = 0.0;
  std::vector<double> sigma_m;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity), high = -low;
  for (const MapLine& line : map.lines) {
    if (line.num_observing >= 2) ++num_multi_view;
    length_m += line.segment_in_world.Length();
    // Across a line two directions are free: the mean variance of them.
    sigma_m.push_back(std::sqrt(0.5 * line.covariance_start.trace()));
    sigma_m.push_back(std::sqrt(0.5 * line.covariance_end.trace()));
    for (const Eigen::Vector3d& end : {line.segment_in_world.start, line.segment_in_world.end}) {
      low = low.cwiseMin(end);
      high = high.cwiseMax(end);
    }
  }
  for (const KeyFrame& frame : map.key_frames) {
    num_segments += frame.segments.size();
    num_points += frame.points.size();
  }
  Json report = NewReport("map_info");
  report["map"] = path;
  report["detector"] = map.detector;
  report["depth"] = NameOf(map.depth_source);
  report["bytes"] = BytesOnDisk(path);
  report["lines"] = map.lines.size();
  report["multi_view_lines"] = num_multi_view;
  report["length_m"] = Rounded(length_m, 3);
  report["key_frames"] = map.key_frames.size();
  report["segments"] = num_segments;
  report["points"] = num_points;
  report["covariance_factor"] = map.covariance_factor;
  report["covariance_growth"] = map.covariance_growth;
  if (map.camera_correction) {
    const ImageCamera& camera = map.camera_correction->corrected;
    report["camera_shift_px"] = Rounded(LargestShiftPx(*map.camera_correction), 3);
    report["camera_fx_fy_cx_cy"] = {Rounded(camera.pinhole.fx, 3), Rounded(camera.pinhole.fy, 3),
                                    Rounded(camera.pinhole.cx, 3), Rounded(camera.pinhole.cy, 3)};
    report["camera_lens"] = ToString(camera.lens.model);
    Json coefficients = Json::array();
    for (const double value : camera.lens.coefficients) coefficients.push_back(Rounded(value, 6));
    report["camera_distortion_coefficients"] = std::move(coefficients);
  }
  if (map.pose_change) {
    report["poses_adjusted_cm"] = Rounded(100.0 * map.pose_change->position_m, 3);
    report["poses_adjusted_deg"] =
        Rounded(180.0 / std::numbers::pi * map.pose_change->rotation_rad, 4);
  }
  if (!map.lines.empty()) {
    report["median_sigma_m"] = Rounded(Percentile(sigma_m, 50.0), 6);
    report["min_m"] = {Rounded(low.x(), 3), Rounded(low.y(), 3), Rounded(low.z(), 3)};
    report["max_m"] = {Rounded(high.x(), 3), Rounded(high.y(), 3), Rounded(high.z(), 3)};
  }
  return report;
}

Outcome RunMapInfo(const MapInfoOptions& options) {
  const Result<LineMap> map = ReadMap(options.map);
  if (!map) return FailureFrom(map.error());
  const Json report = Describe(options.map, *map);
  if (options.json) return PrintJson(report);
  std::string text;
  for (const auto& [key, value] : report.items()) {
    if (key == "schema" || key == "version") continue;
    char label[24];
    std::snprintf(label, sizeof(label), "%-18s", key.c_str());
    text += label + (value.is_string() ? value.get<std::string>() : value.dump()) + "\n";
  }
  return PrintText(text);
}

}  // namespace

void AddMapInfo(CLI::App& map, PendingRun& pending) {
  AddCommand<MapInfoOptions>(
      map, pending, "info", "Check a map and print what it holds",
      [](CLI::App& command, MapInfoOptions& options) {
        command.add_option("map,--map", options.map, "Directory of the map")->required();
        command.add_flag("--json", options.json, "Print JSON");
        command.footer("Example:\n  plumbline map info office.map --json");
      },
      RunMapInfo);
}

}  // namespace plumb::tools
