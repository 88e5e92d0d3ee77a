#include "plumb/map/line_visibility.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "plumb/map/line_cloud.h"

namespace plumb {
namespace {

constexpr double kMinProjectedPx = 15.0;

// The lines that a key frame observed, ascending and once each.
std::vector<uint32_t> ObservedLines(const KeyFrame& frame) {
  std::vector<uint32_t> lines;
  for (const LiftedSegment& segment : frame.segments) {
    if (segment.line) lines.push_back(*segment.line);
  }
  std::sort(lines.begin(), lines.end());
  lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
  return lines;
}

}  // namespace

void ComputeVisibility(LineMap* map) {
  const uint32_t num_frames = static_cast<uint32_t>(map->key_frames.size());
  std::vector<std::vector<uint32_t>> observed(num_frames);
  map->sighting_begin.assign(map->lines.size() + 1, 0);
  for (uint32_t k = 0; k < num_frames; ++k) {
    observed[k] = ObservedLines(map->key_frames[k]);
    for (const uint32_t line : observed[k]) ++map->sighting_begin[line + 1];
  }
  for (size_t i = 0; i < map->lines.size(); ++i) {
    map->sighting_begin[i + 1] += map->sighting_begin[i];
  }

  LineCloud cloud;
  for (MapLine& line : map->lines) {
    line.num_expected = 0;
    cloud.Add(line.segment_in_world);
  }
  map->sightings.resize(map->sighting_begin.back());
  std::vector<uint32_t> next(map->sighting_begin.begin(), map->sighting_begin.end() - 1);
  std::vector<ProjectedLine> projected;
  for (uint32_t k = 0; k < num_frames; ++k) {
    const KeyFrame& frame = map->key_frames[k];
    const Eigen::Vector3d center = frame.cam_from_world.Center();
    for (const uint32_t line : observed[k]) {
      const Eigen::Vector3d to_camera = center - cloud[line].Midpoint();
      map->sightings[next[line]++] = {k, to_camera.normalized().cast<float>(),
                                      static_cast<float>(to_camera.norm())};
      ++map->lines[line].num_expected;
    }
    cloud.Project(frame.camera, frame.cam_from_world, kMinProjectedPx,
                  std::numeric_limits<double>::max(), &projected);
    for (const ProjectedLine& line : projected) {
      if (!std::binary_search(observed[k].begin(), observed[k].end(), line.line)) {
        ++map->lines[line.line].num_expected;
      }
    }
  }
}

}  // namespace plumb
