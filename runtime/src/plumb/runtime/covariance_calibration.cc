#include "plumb/runtime/covariance_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>

#include "plumb/base/median.h"
#include "plumb/map/map_index.h"
#include "plumb/refine/uncertainty.h"
#include "plumb/runtime/covariance_factor.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/line_selection.h"

namespace plumb {
namespace {

constexpr size_t kMaxKeyFrames = 64;
// Of the key frames by distance, how many are passed over before the three that are used.
constexpr uint32_t kSkips[] = {0, 1, 2, 3, 4, 6, 8, 12, 16, 20};
constexpr size_t kMaxSegments = 250, kMinLines = 20, kMinPairs = 10;
constexpr double kPositionSigmaM = 0.10, kRotationSigmaRad = 0.0349;
constexpr double kMedianOfChiSquare6 = 5.348;
constexpr double kMinRatio = 1e-3;  // perfect input
// Growth over factor [1 / (m + rad)] that are tried.
constexpr double kMinShape = 0.1, kMaxShape = 100.0;
constexpr int kNumShapes = 31;

struct MapError {
  double distance;
  double ratio;  // squared error over its expectation
};

class Calibrator {
 public:
  explicit Calibrator(const LineMap& map) : map_(map), index_(map) {}

  std::vector<MapError> Measure() {
    std::vector<MapError> errors;
    const size_t count = map_.key_frames.size();
    const size_t used = std::min(count, kMaxKeyFrames);
    for (size_t i = 0; i < used; ++i) {
      for (const uint32_t skip : kSkips) {
        if (const auto error = MeasureOne(i * count / used, skip)) errors.push_back(*error);
      }
    }
    return errors;
  }

 private:
  std::optional<MapError> MeasureOne(size_t id, uint32_t skip) {
    const KeyFrame& frame = map_.key_frames[id];
    index_.NearestKeyFrames(frame.cam_from_world, kLocalKeyFrames + skip + 1, &others_);
    std::erase(others_, static_cast<uint32_t>(id));
    if (others_.size() < kLocalKeyFrames + skip) return std::nullopt;
    const auto first = others_.begin() + skip;
    others_.assign(first, first + kLocalKeyFrames);
    const double distance = MeanDistance(map_, others_, frame.cam_from_world);
    if (!(distance < kMaxFactorDistance)) return std::nullopt;

    LineMap others;  // nothing but those key frames
    for (const uint32_t k : others_) others.key_frames.push_back(map_.key_frames[k]);
    const MapIndex index(others);
    LineSelector(index).SelectLocal(frame.camera, frame.cam_from_world, &lines_);
    if (lines_.size() < kMinLines) return std::nullopt;
    detected_.clear();
    for (const LiftedSegment& segment : frame.segments) detected_.push_back(segment.segment_px);
    segments_.Assign(detected_, kMaxSegments);
    aligner_.Begin(frame.camera, frame.cam_from_world, lines_, segments_);
    const FineAlignment found =
        aligner_.Run(frame.cam_from_world, LocalSchedule(),
                     {frame.cam_from_world, 2 * kRotationSigmaRad, 2 * kPositionSigmaM});
    if (found.num_pairs < kMinPairs) return std::nullopt;
    const Matrix6d prior =
        PriorCovariance(kRotationSigmaRad, kPositionSigmaM).diagonal().cwiseInverse().asDiagonal();
    const Matrix6d covariance =
        PoseCovariance(found.line_information, found.residual_scale, 1.0, prior);
    const Vector6d error = Difference(frame.cam_from_world, found.cam_from_world);
    const double ratio = error.dot(covariance.ldlt().solve(error)) / kMedianOfChiSquare6;
    if (!std::isfinite(ratio)) return std::nullopt;
    return MapError{distance, std::max(ratio, kMinRatio)};
  }

  const LineMap& map_;
  const MapIndex index_;
  FineAligner aligner_;
  FrameSegments segments_;
  std::vector<uint32_t> others_;
  std::vector<CandidateLine> lines_;
  std::vector<Segment2> detected_;
};

}  // namespace

CovarianceCalibration CalibrateCovariance(const LineMap& map) {
  const std::vector<MapError> errors = Calibrator(map).Measure();
  CovarianceCalibration out{map.covariance_factor, map.covariance_growth, errors.size()};
  if (errors.size() < kMinCalibrationErrors) return out;
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> logs(errors.size());
  for (int s = 0; s <= kNumShapes; ++s) {
    const double shape =
        s == 0 ? 0.0 : kMinShape * std::pow(kMaxShape / kMinShape, (s - 1.0) / (kNumShapes - 1.0));
    for (size_t i = 0; i < errors.size(); ++i) {
      logs[i] = std::log(errors[i].ratio / (1.0 + shape * errors[i].distance));
    }
    const double median = Median(logs);
    double deviation = 0.0;
    for (const double value : logs) deviation += std::abs(value - median);
    if (deviation >= least) continue;
    least = deviation;
    out.factor = std::exp(median);
    out.growth = shape * out.factor;
  }
  return out;
}

}  // namespace plumb
