#include "plumb/geometry/lens.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/LU>

namespace plumb {
namespace {

// No camera sees more on a plane: 82 degrees from the axis.
constexpr double kLargestRadius = 7.0;
constexpr double kRadiusStep = 1.0 / 256.0;
constexpr double kMinSlope = 1.0 / 12.0;
constexpr int kMaxIterations = 50;
constexpr double kConverged = 1e-13, kMaxResidual = 1e-11;

// Factor of the radius and its derivative by the squared radius.
struct Growth {
  double factor = 1.0, by_square = 0.0;
};

Growth RadialGrowth(const std::array<double, 8>& k, double square) {
  const double top = 1.0 + square * (k[0] + square * (k[1] + square * k[4]));
  const double top_slope = k[0] + square * (2.0 * k[1] + square * 3.0 * k[4]);
  const double bottom = 1.0 + square * (k[5] + square * (k[6] + square * k[7]));
  const double bottom_slope = k[5] + square * (2.0 * k[6] + square * 3.0 * k[7]);
  return {top / bottom, (top_slope - top / bottom * bottom_slope) / bottom};
}

// The imaged angle and its derivative by the angle from the axis.
double DistortAngle(const std::array<double, 8>& k, double angle, double* out_slope) {
  const double q = angle * angle;
  *out_slope = 1.0 + q * (3.0 * k[0] + q * (5.0 * k[1] + q * (7.0 * k[2] + q * 9.0 * k[3])));
  return angle * (1.0 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3]))));
}

Growth AngularGrowth(const std::array<double, 8>& k, double square) {
  // Series of atan(r) (1 + k1 atan(r)^2 + ..) / r; the neglected term is below 1e-16.
  if (square < 1e-8) return {1.0 + (k[0] - 1.0 / 3.0) * square, k[0] - 1.0 / 3.0};
  const double radius = std::sqrt(square);
  double slope = 0.0;
  const double imaged = DistortAngle(k, std::atan(radius), &slope);
  const double by_radius = slope / (1.0 + square);
  return {imaged / radius, (by_radius - imaged / radius) / (2.0 * square)};
}

size_t NumCoefficients(LensModel model) {
  if (model == LensModel::kNone) return 0;
  return model == LensModel::kRadTan ? 8 : 4;
}

Error Invalid(const std::string& message) { return {ErrorCode::kInvalidArgument, message}; }

}  // namespace

std::string_view ToString(LensModel model) {
  switch (model) {
    case LensModel::kNone:
      return "NONE";
    case LensModel::kRadTan:
      return "RADTAN";
    case LensModel::kKannalaBrandt:
      return "KANNALA_BRANDT";
  }
  return "UNKNOWN";
}

Result<Lens> MakeLens(LensModel model, std::span<const double> coefficients) {
  const size_t count = coefficients.size();
  const auto wrong_count = [&](const char* wanted) {
    return Invalid(std::string(ToString(model)) + " has " + std::to_string(count) +
                   " distortion coefficients, want " + wanted);
  };
  if (model == LensModel::kNone && count != 0) return wrong_count("none");
  if (model == LensModel::kRadTan && count != 4 && count != 5 && count != 8) {
    return wrong_count("4, 5 or 8");
  }
  if (model == LensModel::kKannalaBrandt && count != 4) return wrong_count("4");
  Lens lens;
  lens.model = model;
  for (size_t i = 0; i < count; ++i) {
    if (!std::isfinite(coefficients[i])) {
      return Invalid("distortion coefficient " + std::to_string(i) + " is " +
                     std::to_string(coefficients[i]) + ", not finite");
    }
    lens.coefficients[i] = coefficients[i];
  }
  return lens;
}

Result<LensMapping> LensMapping::Create(const Lens& lens) {
  LensMapping mapping;
  if (lens.IsNone()) return mapping;
  for (size_t i = 0; i < lens.coefficients.size(); ++i) {
    const double value = lens.coefficients[i];
    if (!std::isfinite(value)) {
      return Invalid("distortion coefficient " + std::to_string(i) + " is " +
                     std::to_string(value) + ", not finite");
    }
    if (i >= NumCoefficients(lens.model) && value != 0.0) {
      return Invalid("distortion coefficient " + std::to_string(i) + " is " +
                     std::to_string(value) + ", which " + std::string(ToString(lens.model)) +
                     " does not have");
    }
  }
  mapping.lens_ = lens;
  // Where the image stops growing: a scan, then halving.
  const auto grows = [&mapping](double radius) {
    double slope = 0.0;
    const double distorted = mapping.DistortedRadius(radius, &slope);
    return std::isfinite(distorted) && slope >= kMinSlope && slope <= 1.0 / kMinSlope;
  };
  double low = 0.0;
  while (low < kLargestRadius && grows(low + kRadiusStep)) low += kRadiusStep;
  if (low == 0.0) {
    return Invalid(std::string(ToString(lens.model)) +
                   " with these distortion coefficients does not grow from the image's centre");
  }
  double high = low + kRadiusStep;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (grows(middle) ? low : high) = middle;
  }
  mapping.max_radius_ = low;
  double slope = 0.0;
  mapping.max_distorted_radius_ = mapping.DistortedRadius(low, &slope);
  return mapping;
}

double LensMapping::DistortedRadius(double radius, double* out_slope) const {
  if (lens_.model == LensModel::kKannalaBrandt) {
    const double distorted = DistortAngle(lens_.coefficients, std::atan(radius), out_slope);
    *out_slope /= 1.0 + radius * radius;
    return distorted;
  }
  const double square = radius * radius;
  const Growth growth = RadialGrowth(lens_.coefficients, square);
  *out_slope = growth.factor + 2.0 * square * growth.by_square;
  return radius * growth.factor;
}

std::optional<DistortedPoint> LensMapping::Distort(const Eigen::Vector2d& ideal) const {
  if (lens_.IsNone()) return DistortedPoint{ideal, Eigen::Matrix2d::Identity()};
  const double x = ideal.x(), y = ideal.y(), square = ideal.squaredNorm();
  if (!(square <= max_radius_ * max_radius_)) return std::nullopt;  // also NaN
  const auto& k = lens_.coefficients;
  const bool is_radial = lens_.model == LensModel::kRadTan;
  const Growth growth = is_radial ? RadialGrowth(k, square) : AngularGrowth(k, square);
  DistortedPoint out;
  out.point = growth.factor * ideal;
  out.jacobian << growth.factor + 2.0 * x * x * growth.by_square, 2.0 * x * y * growth.by_square,
      2.0 * x * y * growth.by_square, growth.factor + 2.0 * y * y * growth.by_square;
  if (is_radial) {
    const double p1 = k[2], p2 = k[3];
    out.point += Eigen::Vector2d(2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                                 p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y);
    const double mixed = 2.0 * (p1 * x + p2 * y);
    out.jacobian(0, 0) += 2.0 * p1 * y + 6.0 * p2 * x;
    out.jacobian(0, 1) += mixed;
    out.jacobian(1, 0) += mixed;
    out.jacobian(1, 1) += 6.0 * p1 * y + 2.0 * p2 * x;
  }
  return out;
}

std::optional<double> LensMapping::UndistortRadius(double distorted_radius) const {
  if (!(distorted_radius <= max_distorted_radius_)) return std::nullopt;
  // The angle serves where the model is a polynomial of it: no arc tangent in the loop.
  const bool is_angular = lens_.model == LensModel::kKannalaBrandt;
  double low = 0.0, high = is_angular ? std::atan(max_radius_) : max_radius_;
  double value = std::min(distorted_radius, high);
  for (int i = 0; i < kMaxIterations; ++i) {
    double slope = 0.0;
    const double error = (is_angular ? DistortAngle(lens_.coefficients, value, &slope)
                                     : DistortedRadius(value, &slope)) -
                         distorted_radius;
    (error > 0.0 ? high : low) = value;
    double next = value - error / slope;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = std::abs(next - value);
    value = next;
    if (step <= kConverged) return is_angular ? std::tan(value) : value;
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2d> LensMapping::Undistort(const Eigen::Vector2d& distorted) const {
  if (lens_.IsNone()) return distorted;
  const double distorted_radius = distorted.norm();
  if (!std::isfinite(distorted_radius)) return std::nullopt;
  const auto& k = lens_.coefficients;
  const bool is_tangential = lens_.model == LensModel::kRadTan && (k[2] != 0.0 || k[3] != 0.0);
  // Tangential terms move a point a little further than the radial ones reach.
  const double start_radius =
      is_tangential ? std::min(distorted_radius, 0.98 * max_distorted_radius_) : distorted_radius;
  const std::optional<double> radius = UndistortRadius(start_radius);
  if (!radius) return std::nullopt;
  Eigen::Vector2d ideal = distorted;
  if (distorted_radius > 0.0) ideal *= *radius / distorted_radius;
  if (!is_tangential) return ideal;
  for (int i = 0; i < kMaxIterations; ++i) {
    const std::optional<DistortedPoint> at = Distort(ideal);
    if (!at || !(at->jacobian.determinant() > 0.0)) return std::nullopt;
    const Eigen::Vector2d error = at->point - distorted;
    const Eigen::Vector2d step = at->jacobian.inverse() * error;
    ideal -= step;
    if (step.norm() > kConverged) continue;
    return error.norm() <= kMaxResidual && ideal.norm() <= max_radius_ ? std::optional(ideal)
                                                                       : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace plumb
