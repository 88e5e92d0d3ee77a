// The points' part of the normal equations, several points at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/refine/normal_equations.h"
#include "plumb/refine/row_sums.h"

namespace plumb {

/// PointObservation as parallel arrays, in the frame of a camera near which they are projected.
struct PointTable {
  /// No allocation once the capacity suffices.
  void Assign(std::span<const PointObservation> points, const Rigid3& reference_from_world);
  /// The rows named by `kept` of another table.
  void AssignRows(const PointTable& other, std::span<const uint32_t> kept);

  /// Lets rows of the same pixel, one image point matched to several key frames, share the weight
  /// of one: they share its noise, and their map points mostly a bias.
  /// @return how many different pixels there are.
  size_t ShareWeights();

  size_t size() const { return u.size(); }

  Rigid3 reference_from_world;
  std::vector<float> u, v;     // [px]
  std::vector<float> x, y, z;  // [m]
  std::vector<float> deviation_x, deviation_y, deviation_z;
  std::vector<float> weight;

 private:
  std::vector<uint32_t> order_;
};

/// PointAccumulator in single precision over a table. Owns its work space and does not allocate
/// once warm; not thread-safe.
class PointTableAccumulator {
 public:
  /// @param scale  By which the whitened squares are divided; 0: their median / 1.386, at least
  ///               0.09.
  PointAccumulator::Equations Accumulate(const Camera& camera, const Rigid3& cam_from_world,
                                         const PointTable& points, double scale = 0.0);

  /// Rows of the points whose image is within `max_px` of their pixel, ascending.
  void FindNear(const Camera& camera, const Rigid3& cam_from_world, const PointTable& points,
                double max_px, std::vector<uint32_t>* out_rows);

 private:
  void Evaluate(const Camera& camera, const Rigid3& cam_from_world, const PointTable& points);

  ResidualRows rows_;  // of u, then of v, whitened
  std::vector<float> square_, plain_square_, usable_;
  std::vector<int32_t> bits_;  // of the usable squares
};

}  // namespace plumb
