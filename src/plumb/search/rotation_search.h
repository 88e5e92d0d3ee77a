// Rotation first: rotations under which the segments can be images of the map's main directions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/segment.h"
#include "plumb/search/direction_clusters.h"
#include "plumb/search/random.h"

namespace plumb {

/// Gaussian of rotation vectors.
struct RotationSpread {
  float sigma_rad = 0.02f;  // per component
  /// Unit: the components across it have `tilt_sigma_rad` instead. Zero: none.
  Eigen::Vector3f axis = Eigen::Vector3f::Zero();
  float tilt_sigma_rad = 0.0f;
};
Eigen::Vector3f Draw(const RotationSpread& spread, Random* random);

struct RotationSearchOptions {
  uint32_t num_draws = 1500;
  size_t num_kept = 24;
  RotationSpread spread;
};

/// Draws rotations around the identity and keeps the best by
///
///   S(R) = sum over segments of min(length, 150 px) max over clusters d of k(n . R d) min(1, 3
///   W_d)
///
/// n: unit normal of the segment's interpretation plane; W: cluster weight; k: Tukey's biweight
/// with the width of a Gaussian of 1.5 deg. The position does not matter: a direction is seen at
/// infinity. Source: docs/method/association.md. Owns its work space; not thread-safe.
class RotationSearch {
 public:
  /// @param clusters   At most 16 count. In the camera frame of the prior, like `out_rotations`
  /// (cam_from_prior).
  /// @param out_rotations  Best first; the identity is one of the draws.
  void Search(const Camera& camera, std::span<const Segment2> segments,
              std::span<const DirectionCluster> clusters, const RotationSearchOptions& options,
              Random* random, std::vector<Eigen::Matrix3f>* out_rotations);

 private:
  struct Draw {
    Eigen::Matrix3f rotation;
    float score;
  };
  float Score(const Eigen::Matrix3f& rotation, std::span<const DirectionCluster> clusters);

  std::vector<float> normal_x_, normal_y_, normal_z_, length_;
  std::vector<Draw> draws_;
  std::vector<uint32_t> order_;
};

/// Rotation by 2 atan(|w| / 2), which is nearly |w|, about w.
Eigen::Matrix3f RotationFromVector(const Eigen::Vector3f& w);

}  // namespace plumb
