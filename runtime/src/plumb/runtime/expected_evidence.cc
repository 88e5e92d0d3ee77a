#include "plumb/runtime/expected_evidence.h"

#include <algorithm>
#include <limits>

namespace plumb {
namespace {

constexpr uint32_t kNumKeyFrames = 3;
constexpr size_t kMaxSegments = 250;
constexpr double kRotationSigmaRad = 0.035;  // of the search from 2 deg

}  // namespace

ExpectedEvidence::ExpectedEvidence(const MapIndex& index)
    : index_(index), selector_(index), known_(index.map().key_frames.size(), -1.0f) {}

double ExpectedEvidence::LeastNear(const Rigid3& cam_from_world) {
  index_.NearestKeyFrames(cam_from_world, kNumKeyFrames, &nearest_);
  if (nearest_.size() < kNumKeyFrames) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (const uint32_t k : nearest_) {
    const PoseDistance distance =
        DistanceBetween(index_.map().key_frames[k].cam_from_world, cam_from_world);
    if (distance.position_m + distance.rotation_rad > kMaxDistance) return 0.0;
    least = std::min(least, EvidenceOf(k));
  }
  return least;
}

double ExpectedEvidence::EvidenceOf(uint32_t key_frame) {
  float& known = known_[key_frame];
  if (known >= 0.0f) return static_cast<double>(known);
  const KeyFrame& frame = index_.map().key_frames[key_frame];
  detected_.clear();
  for (const LiftedSegment& segment : frame.segments) detected_.push_back(segment.segment_px);
  segments_.Assign(detected_, kMaxSegments);
  selector_.SelectForSearch(frame.camera, frame.cam_from_world, kRotationSigmaRad, &lines_);
  ProjectCandidates(frame.camera, frame.cam_from_world, lines_, kMinVisiblePx, &projected_);
  known = static_cast<float>(meter_.Measure(projected_, segments_.table).nats);
  return static_cast<double>(known);
}

}  // namespace plumb
