#include "plumb/map/lift_fusion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace plumb {
namespace {

constexpr double kMaxViewsSigma = 0.03;  // over the inverse depth
constexpr double kMaxDeviation = 3.0;    // of depths that agree, in standard deviations

// Of a part's ends.
struct EndDepths {
  std::array<Eigen::Vector2d, 2> rays;
  std::array<double, 2> sensor;              // inverse depths [1/m]
  std::array<double, 2> views, views_sigma;  // the same; of no meaning without triangulated segment
};

EndDepths DepthsOf(const LiftedPart& part, const Segment2& source,
                   const TriangulatedSegment* by_views) {
  EndDepths out{};
  const Eigen::Vector2d delta = source.Delta();
  const std::array in_cam{part.segment_in_cam.start, part.segment_in_cam.end};
  const std::array px{part.segment_px.start, part.segment_px.end};
  for (int end = 0; end < 2; ++end) {
    out.rays[end] = in_cam[end].hnormalized();
    out.sensor[end] = 1.0 / in_cam[end].z();
    if (by_views == nullptr) continue;
    // A line's inverse depth is linear along its image.
    const double u = (px[end] - source.start).dot(delta) / delta.squaredNorm();
    const double at_start = (1.0 - u) / by_views->depth_m[0], at_end = u / by_views->depth_m[1];
    out.views[end] = at_start + at_end;
    out.views_sigma[end] = std::hypot(at_start * by_views->sigma_m[0] / by_views->depth_m[0],
                                      at_end * by_views->sigma_m[1] / by_views->depth_m[1]);
  }
  return out;
}

// Calls visit(part, what the views say of it or nullptr), in order.
template <typename Visit>
void ForEachPart(const FrameLifts& frame, const Visit& visit) {
  auto by_views = frame.by_views.begin();
  for (const LiftedPart& part : frame.by_sensor) {
    while (by_views != frame.by_views.end() && by_views->source < part.source) ++by_views;
    const bool both = by_views != frame.by_views.end() && by_views->source == part.source;
    visit(part, both ? &*by_views : nullptr);
  }
}

}  // namespace

std::vector<DepthSample> CompareDepths(std::span<const FrameLifts> frames) {
  std::vector<DepthSample> samples;
  for (uint32_t k = 0; k < frames.size(); ++k) {
    ForEachPart(frames[k], [&](const LiftedPart& part, const TriangulatedSegment* by_views) {
      if (by_views == nullptr) return;
      const EndDepths depths = DepthsOf(part, frames[k].segments[part.source], by_views);
      for (int end = 0; end < 2; ++end) {
        if (!(depths.views_sigma[end] < kMaxViewsSigma * depths.views[end])) continue;
        samples.push_back(
            {depths.rays[end], depths.sensor[end], depths.views[end], depths.views_sigma[end], k});
      }
    });
  }
  return samples;
}

std::vector<LiftedSegment> FuseLifts(const FrameLifts& frame, const DepthFit& fit,
                                     const DepthNoise& noise, size_t* out_num_averaged) {
  std::vector<LiftedSegment> fused;
  const Rigid3 world_from_cam = frame.cam_from_world.Inverse();
  ForEachPart(frame, [&](const LiftedPart& part, const TriangulatedSegment* by_views) {
    const EndDepths depths = DepthsOf(part, frame.segments[part.source], by_views);
    std::array<double, 2> corrected{}, mean{};
    bool agree = by_views != nullptr;
    for (int end = 0; end < 2; ++end) {
      corrected[end] = fit.correction(depths.rays[end], depths.sensor[end]);
      const double sensor_sigma = fit.noise_factor * noise.InverseSigmaAt(corrected[end]);
      const double views_sigma = depths.views_sigma[end];
      const double deviation = depths.views[end] - corrected[end];
      agree = agree && std::abs(deviation) < kMaxDeviation * std::hypot(sensor_sigma, views_sigma);
      const double share =
          sensor_sigma * sensor_sigma / (sensor_sigma * sensor_sigma + views_sigma * views_sigma);
      mean[end] = corrected[end] + share * deviation;
    }
    const std::array<double, 2>& inverse = agree ? mean : corrected;
    if (agree && out_num_averaged != nullptr) ++*out_num_averaged;
    const auto in_world = [&](int end) {
      return Eigen::Vector3d(world_from_cam * (depths.rays[end].homogeneous() / inverse[end]));
    };
    fused.push_back({part.segment_px, {in_world(0), in_world(1)}, std::nullopt});
  });
  auto by_sensor = frame.by_sensor.begin();
  for (const TriangulatedSegment& segment : frame.by_views) {
    while (by_sensor != frame.by_sensor.end() && by_sensor->source < segment.source) ++by_sensor;
    if (by_sensor != frame.by_sensor.end() && by_sensor->source == segment.source) continue;
    fused.push_back({frame.segments[segment.source], segment.segment_in_world, std::nullopt});
  }
  return fused;
}

}  // namespace plumb
