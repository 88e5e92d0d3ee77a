#include "plumb/runtime/pose_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plumb/base/median.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/map/depth_view.h"

namespace plumb {
namespace {

// A frame's depth errors are largely common to its segments (scale, warp of the sensor), so that
// its many segments must not count as so many measurements. docs/adr/0013.
constexpr double kDepthSigmaFactor = 5.0;
// Of a segment's deviation, round by round.
constexpr std::array kPixelSigmaFactors = {4.0, 2.0, 1.0, 1.0};

bool IsUsed(const LineMap& map, const LiftedSegment& segment) {
  return segment.line && map.lines[*segment.line].num_observing > 1;
}

// Median mean distance [px] of the used segments' ends from their projected lines.
double MedianDistance(const LineMap& map, std::span<const Rigid3> poses,
                      std::span<const Segment3> lines) {
  std::vector<double> distances;
  for (size_t k = 0; k < map.key_frames.size(); ++k) {
    const Rigid3& pose = poses[k];
    for (const LiftedSegment& segment : map.key_frames[k].segments) {
      if (!IsUsed(map, segment)) continue;
      const Segment3& line = lines[*segment.line];
      const auto image =
          ProjectLine(map.key_frames[k].camera, {pose * line.start, pose * line.end});
      if (!image) continue;
      distances.push_back(0.5 * (std::abs(image->SignedDistance(segment.segment_px.start)) +
                                 std::abs(image->SignedDistance(segment.segment_px.end))));
    }
  }
  return Median(distances);
}

}  // namespace

std::optional<MapPoses> AdjustMapPoses(const LineMap& map, std::span<const Rigid3> priors,
                                       const BundleOptions& options) {
  if (priors.size() != map.key_frames.size()) return std::nullopt;
  const DepthNoise noise;
  std::vector<BundleView> views;
  std::vector<Rigid3> start;
  std::vector<BundleSighting> sightings;
  for (uint32_t k = 0; k < map.key_frames.size(); ++k) {
    const KeyFrame& frame = map.key_frames[k];
    const Camera& camera = frame.camera;
    views.push_back({priors[k], frame.cam_from_world, {camera.fx, camera.fy}});
    start.push_back(frame.cam_from_world);
    for (const LiftedSegment& segment : frame.segments) {
      if (!IsUsed(map, segment)) continue;
      BundleSighting& sighting = sightings.emplace_back();
      sighting.view = k;
      sighting.line = *segment.line;
      sighting.segment_normalized = {camera.Normalize(segment.segment_px.start),
                                     camera.Normalize(segment.segment_px.end)};
      if (map.depth_source != DepthSource::kSensor) continue;  // views would be counted twice
      sighting.lifted_in_cam = Segment3{frame.cam_from_world * segment.segment_in_world.start,
                                        frame.cam_from_world * segment.segment_in_world.end};
      sighting.depth_sigma_m =
          kDepthSigmaFactor * noise.SigmaAt(sighting.lifted_in_cam->Midpoint().z());
    }
  }
  if (sightings.empty()) return std::nullopt;
  std::vector<Segment3> lines;
  for (const MapLine& line : map.lines) lines.push_back(line.segment_in_world);

  std::optional<Bundle> bundle = AdjustBundle(views, lines, sightings, options);
  if (!bundle) return std::nullopt;
  MapPoses out;
  out.before_px = MedianDistance(map, start, lines);
  out.after_px = MedianDistance(map, bundle->cam_from_world, bundle->lines_in_world);
  out.cam_from_world = std::move(bundle->cam_from_world);
  return out;
}

Result<AdjustedMap> BuildAdjustedMap(MapBuilder* builder, const BundleOptions& options,
                                     const MapBuildProgress& progress) {
  constexpr double kBuilds = kPixelSigmaFactors.size() + 1.0;
  double built = 0.0;
  const auto build = [&]() {
    const double before = built++;
    return builder->Build([&progress, before](double done) {
      if (progress) progress((before + done) / kBuilds);
    });
  };
  Result<LineMap> map = build();
  if (!map) return map.error();
  AdjustedMap out;
  std::vector<Rigid3> priors;
  for (const KeyFrame& frame : map->key_frames) priors.push_back(frame.cam_from_world);
  for (const double factor : kPixelSigmaFactors) {
    BundleOptions of_round = options;
    of_round.pixel_sigma_px *= factor;
    const std::optional<MapPoses> poses = AdjustMapPoses(*map, priors, of_round);
    if (!poses) break;
    if (!map->pose_change) out.before_px = poses->before_px;
    out.after_px = poses->after_px;
    if (const Status moved = builder->SetPoses(poses->cam_from_world); !moved) {
      return moved.error();
    }
    map = build();
    if (!map) return map.error();
    map->pose_change = MedianChange(priors, poses->cam_from_world);
  }
  if (progress) progress(1.0);
  out.map = *std::move(map);
  return out;
}

PoseChange MedianChange(std::span<const Rigid3> priors, std::span<const Rigid3> poses) {
  std::vector<double> position_m, rotation_rad;
  for (size_t k = 0; k < std::min(priors.size(), poses.size()); ++k) {
    const PoseDistance distance = DistanceBetween(priors[k], poses[k]);
    position_m.push_back(distance.position_m);
    rotation_rad.push_back(distance.rotation_rad);
  }
  return {Median(position_m), Median(rotation_rad)};
}

}  // namespace plumb
