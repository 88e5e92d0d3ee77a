// Lens distortion: from the ideal pinhole ray to where the lens images it, and back.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

#include <Eigen/Core>

#include "plumb/base/result.h"

namespace plumb {

/// Both act on the plane z = 1: (x, y) = (X / Z, Y / Z) without the lens becomes (x', y') with it,
/// and pixels are fx x' + cx, fy y' + cy. Coefficients in OpenCV's order.
enum class LensModel {
  kNone,
  /// k1 k2 p1 p2 [k3 [k4 k5 k6]]: radial (rational with k4 k5 k6) and tangential.
  /// Source: Brown, Photogrammetric Engineering 1966; OpenCV calib3d, "Camera calibration".
  kRadTan,
  /// k1 k2 k3 k4 over the angle t from the axis: r' = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8).
  /// Source: Kannala & Brandt, TPAMI 2006; OpenCV's fisheye module.
  kKannalaBrandt,
};

/// Plain data; unused coefficients are 0.
struct Lens {
  LensModel model = LensModel::kNone;
  std::array<double, 8> coefficients{};

  bool IsNone() const { return model == LensModel::kNone; }
  friend bool operator==(const Lens&, const Lens&) = default;
};

/// "NONE", "RADTAN", "KANNALA_BRANDT".
std::string_view ToString(LensModel model);

/// A lens of as many coefficients as its model takes: 4, 5 or 8 of kRadTan, 4 of kKannalaBrandt.
/// @return kInvalidArgument naming the count or the coefficient that is not finite.
Result<Lens> MakeLens(LensModel model, std::span<const double> coefficients);

/// Where a ray goes and how its surroundings are stretched.
struct DistortedPoint {
  Eigen::Vector2d point;     // (x', y')
  Eigen::Matrix2d jacobian;  // of (x', y') by (x, y)
};

/// A lens that can be inverted: up to max_radius() the image grows with the ray's radius, and by a
/// twelfth at least, as beyond that a pixel's noise says nothing. Plain data, no allocation.
class LensMapping {
 public:
  /// @return kInvalidArgument when a coefficient is not finite or is one that the model lacks, or
  ///         the image does not grow with the radius even at the centre.
  static Result<LensMapping> Create(const Lens& lens);

  /// Of the mapping without a lens: identity.
  LensMapping() = default;

  const Lens& lens() const { return lens_; }
  /// Largest radius on the plane z = 1 that can be told apart from smaller ones.
  double max_radius() const { return max_radius_; }

  /// @return nothing beyond max_radius().
  std::optional<DistortedPoint> Distort(const Eigen::Vector2d& ideal) const;

  /// The inverse, to 1e-12: Newton's method, radial with brackets first, then in the plane when
  /// there are tangential coefficients.
  /// @return nothing where no radius up to max_radius() is imaged.
  std::optional<Eigen::Vector2d> Undistort(const Eigen::Vector2d& distorted) const;

 private:
  double DistortedRadius(double radius, double* out_slope) const;
  std::optional<double> UndistortRadius(double distorted_radius) const;

  Lens lens_;
  double max_radius_ = 1e9, max_distorted_radius_ = 1e9;
};

}  // namespace plumb
