#include "plumb/map/lift_side.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/LU>

namespace plumb {
namespace {

constexpr std::array<int, 5> kOffsetsPx = {2, 3, 4, 5, 6};  // beside the edge, never on it
constexpr int kOffsets = static_cast<int>(kOffsetsPx.size());
constexpr int kSamples = kLiftColumns * kOffsets;
constexpr int kDraws = 40;
constexpr int kRefits = 3;
constexpr float kMaxSlope = 0.15f;  // across the segment [1/m per 10 px]: steeper is not a surface
constexpr float kNoDepth = 1e9f;    // [1/m]: never an inlier
constexpr double kDamping = 1e-6;

using Samples = std::array<float, kSamples>;

// Where the samples lie in the segment's own coordinates, and minimal subsets of them. Both are the
// same for all segments, hence so are the inverses of the subsets' 3 x 3 systems.
struct SampleLayout {
  Samples along;                  // u - 0.5
  std::array<Samples, 2> across;  // o / 10, for sign -1 and +1
  struct Draw {
    std::array<int, 3> samples;
    Eigen::Matrix3f inverse[2];
  };
  std::vector<Draw> draws;

  SampleLayout() {
    for (int i = 0; i < kSamples; ++i) {
      along[i] = (static_cast<float>(i / kOffsets) + 0.5f) / kLiftColumns - 0.5f;
      across[1][i] = 0.1f * static_cast<float>(kOffsetsPx[i % kOffsets]);
      across[0][i] = -across[1][i];
    }
    uint32_t state = 1;
    const auto next_sample =
        [&state] {  // Numerical Recipes' generator: fixed draws on every machine
          state = state * 1664525u + 1013904223u;
          return static_cast<int>((static_cast<uint64_t>(state) * kSamples) >> 32);
        };
    while (draws.size() < kDraws) {
      Draw draw;
      for (int& sample : draw.samples) sample = next_sample();
      const Eigen::Matrix3f system = System(draw.samples, 1);
      if (std::abs(system.determinant()) < 0.01f) continue;  // nearly collinear
      draw.inverse[0] = System(draw.samples, 0).inverse();
      draw.inverse[1] = system.inverse();
      draws.push_back(draw);
    }
  }

  Eigen::Matrix3f System(const std::array<int, 3>& samples, int side) const {
    Eigen::Matrix3f system;
    for (int r = 0; r < 3; ++r) {
      system.row(r) << 1.0f, along[samples[r]], across[side][samples[r]];
    }
    return system;
  }
};

// Inverse depths of the samples, kNoDepth where there is none. Returns how many there are.
int Sample(const DepthView& depth, const Segment2& segment, int sign, const LiftOptions& options,
           const Rectifier* rectifier, Samples* inverse_depth) {
  const Eigen::Vector2d delta = segment.Delta();
  Eigen::Vector2d normal = Eigen::Vector2d(-delta.y(), delta.x()).normalized() * sign;
  if (rectifier != nullptr) {
    const auto middle = rectifier->ToImage(segment.Midpoint());
    if (middle) normal *= middle->StretchAcross(delta.normalized());
  }
  int num_valid = 0;
  for (int column = 0; column < kLiftColumns; ++column) {
    const Eigen::Vector2d on_edge = segment.start + (column + 0.5) / kLiftColumns * delta;
    for (int k = 0; k < kOffsets; ++k) {
      Eigen::Vector2d at = on_edge + kOffsetsPx[k] * normal;
      float& out = (*inverse_depth)[column * kOffsets + k];
      out = kNoDepth;
      if (rectifier != nullptr) {
        const auto in_image = rectifier->ToImage(at);
        if (!in_image) continue;
        at = in_image->px;
      }
      // Compare before rounding: segments may reach far outside the image.
      if (!(at.x() > -0.5 && at.y() > -0.5 && at.x() < depth.width_px - 0.5 &&
            at.y() < depth.height_px - 0.5)) {
        continue;
      }
      const float z = depth.MetresAt(static_cast<int>(std::lround(at.x())),
                                     static_cast<int>(std::lround(at.y())));
      if (!(z > options.min_depth_m && z < options.max_depth_m)) continue;
      out = 1.0f / z;
      ++num_valid;
    }
  }
  return num_valid;
}

int CountInliers(const Samples& inverse_depth, const Samples& along, const Samples& across,
                 const Eigen::Vector3f& plane, float tolerance) {
  const float a = plane[0], b = plane[1], c = plane[2];
  int count = 0;
  for (int i = 0; i < kSamples; ++i) {
    count += std::abs(inverse_depth[i] - (a + b * along[i] + c * across[i])) < tolerance ? 1 : 0;
  }
  return count;
}

Eigen::Vector3f Refit(const Samples& inverse_depth, const Samples& along, const Samples& across,
                      const Eigen::Vector3f& plane, float tolerance) {
  Eigen::Matrix3d information = kDamping * Eigen::Matrix3d::Identity();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3f x(1.0f, along[i], across[i]);
    if (!(std::abs(inverse_depth[i] - plane.dot(x)) < tolerance)) continue;
    const Eigen::Vector3d xd = x.cast<double>();
    information += xd * xd.transpose();
    moment += xd * static_cast<double>(inverse_depth[i]);
  }
  return Eigen::Vector3d(information.inverse() * moment).cast<float>();
}

double MedianOfValid(const Samples& inverse_depth, int num_valid) {
  if (num_valid == 0) return 0.0;
  Samples sorted = inverse_depth;  // kNoDepth sorts behind every valid value
  std::nth_element(sorted.begin(), sorted.begin() + num_valid / 2, sorted.end());
  return sorted[num_valid / 2];
}

}  // namespace

LiftSide FitLiftSide(const DepthView& depth, const Segment2& segment_px, int sign,
                     const LiftOptions& options, const Rectifier* rectifier) {
  static const SampleLayout layout;
  const int side = sign > 0 ? 1 : 0;
  const Samples& across = layout.across[side];
  const float tolerance = static_cast<float>(options.inverse_depth_tolerance);

  LiftSide out;
  Samples inverse_depth;
  const int num_valid = Sample(depth, segment_px, sign, options, rectifier, &inverse_depth);
  out.valid_share = static_cast<double>(num_valid) / kSamples;
  out.median_inverse_depth = MedianOfValid(inverse_depth, num_valid);

  Eigen::Vector3f best = Eigen::Vector3f::Zero();
  int best_count = 0;
  for (const SampleLayout::Draw& draw : layout.draws) {
    const Eigen::Vector3f values(inverse_depth[draw.samples[0]], inverse_depth[draw.samples[1]],
                                 inverse_depth[draw.samples[2]]);
    if (values.maxCoeff() == kNoDepth) continue;
    const Eigen::Vector3f plane = draw.inverse[side] * values;
    if (!(std::abs(plane[2]) < kMaxSlope)) continue;
    const int count = CountInliers(inverse_depth, layout.along, across, plane, tolerance);
    if (count > best_count) {
      best_count = count;
      best = plane;
    }
  }
  if (best_count == 0) return out;
  for (int k = 0; k < kRefits; ++k) {
    best = Refit(inverse_depth, layout.along, across, best, tolerance);
  }

  int num_inliers = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3f x(1.0f, layout.along[i], across[i]);
    if (!(std::abs(inverse_depth[i] - best.dot(x)) < tolerance)) continue;
    ++num_inliers;
    out.column_share[i / kOffsets] += 1.0f / kOffsets;
  }
  out.plane = best.cast<double>();
  out.inlier_share = static_cast<double>(num_inliers) / num_valid;
  return out;
}

}  // namespace plumb
