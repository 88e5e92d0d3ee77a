#include "plumb/map/track_filter.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

namespace plumb {
namespace {

constexpr double kMinSquareSine = 1e-4;  // of ray and line, about 0.6 deg: nearest point undefined

// Point of the (infinite) line nearest to the ray through the camera centre.
std::optional<Eigen::Vector3d> NearestToRay(const Segment3& line, const Eigen::Vector3d& center,
                                            const Eigen::Vector3d& ray) {
  const Eigen::Vector3d direction = line.Delta().normalized();
  const double cosine = direction.dot(ray);
  const double square_sine = 1.0 - cosine * cosine;
  if (!(square_sine > kMinSquareSine)) return std::nullopt;
  const Eigen::Vector3d offset = line.start - center;
  const double along = (cosine * ray.dot(offset) - direction.dot(offset)) / square_sine;
  return line.start + along * direction;
}

std::optional<Segment3> Predict(const ObservationTable& table, uint32_t id,
                                const Segment3& line_of_others) {
  const Eigen::Vector3d center = table.cam_from_world(table.frame_of(id)).Center();
  const Segment3& lifted = table[id].lifted_in_world;  // its ends lie on the end points' rays
  const auto start = NearestToRay(line_of_others, center, (lifted.start - center).normalized());
  const auto end = NearestToRay(line_of_others, center, (lifted.end - center).normalized());
  if (!start || !end) return std::nullopt;
  return Segment3{*start, *end};
}

struct FrameTest {
  std::vector<PnpObservation> observations;
  std::vector<uint32_t> ids;
};

// One Gauss-Newton step away from the fit to all frames gives the fit without one of them.
void PredictTrack(const ObservationTable& table, const LineFitOptions& fit, const LineTrack& track,
                  std::vector<FrameTest>* tests) {
  const std::vector<uint32_t>& ids = track.observations;
  if (ids.empty() || table.frame_of(ids.front()) == table.frame_of(ids.back())) return;
  const std::optional<AnchoredLine> line = AnchoredLine::Create(track.segment_in_world);
  if (!line) return;
  LineSystem all;
  for (const uint32_t id : ids) all.Add(*line, table[id], fit);
  for (size_t begin = 0, end = 0; begin < ids.size(); begin = end) {
    const uint32_t frame = table.frame_of(ids[begin]);
    LineSystem own;
    while (end < ids.size() && table.frame_of(ids[end]) == frame) {
      own.Add(*line, table[ids[end++]], fit);
    }
    LineSystem others;
    others.information = all.information - own.information;
    others.gradient = all.gradient - own.gradient;
    const Segment3 line_of_others = line->Moved(others.Step()).anchors_in_world;
    for (size_t k = begin; k < end; ++k) {
      const std::optional<Segment3> predicted = Predict(table, ids[k], line_of_others);
      if (!predicted) continue;
      (*tests)[frame].observations.push_back({table.segment_px(ids[k]), *predicted});
      (*tests)[frame].ids.push_back(ids[k]);
    }
  }
}

}  // namespace

std::vector<uint32_t> FilterTracks(const ObservationTable& table, const LineFitOptions& fit,
                                   const PnpFilterOptions& options,
                                   std::vector<LineTrack>* tracks) {
  std::vector<FrameTest> tests(table.num_frames());
  for (const LineTrack& track : *tracks) PredictTrack(table, fit, track, &tests);

  std::vector<uint32_t> removed;
  for (uint32_t frame = 0; frame < table.num_frames(); ++frame) {
    const FrameTest& test = tests[frame];
    const std::vector<bool> inliers = PnpInliers(table.camera(frame), test.observations, options);
    for (size_t i = 0; i < inliers.size(); ++i) {
      if (!inliers[i]) removed.push_back(test.ids[i]);
    }
  }
  std::sort(removed.begin(), removed.end());
  for (LineTrack& track : *tracks) {
    std::erase_if(track.observations, [&removed](uint32_t id) {
      return std::binary_search(removed.begin(), removed.end(), id);
    });
  }
  return removed;
}

}  // namespace plumb
