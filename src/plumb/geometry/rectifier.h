// Between the pixels of a camera's image and those of the ideal pinhole image behind its lens.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "plumb/base/result.h"
#include "plumb/geometry/camera.h"
#include "plumb/geometry/lens.h"

namespace plumb {

/// A camera as it took the image. `Camera` alone is always ideal: without a lens.
struct ImageCamera {
  Camera pinhole;  // focal lengths, principal point and size of the image that was taken
  Lens lens;

  ImageCamera() = default;
  ImageCamera(const Camera& camera) : pinhole(camera) {}  // one without distortion
  ImageCamera(const Camera& camera, const Lens& with_lens) : pinhole(camera), lens(with_lens) {}
  friend bool operator==(const ImageCamera&, const ImageCamera&) = default;
};

/// A place in the image, and how the ideal image is stretched there.
struct ImagePoint {
  Eigen::Vector2d px;
  Eigen::Matrix2d jacobian;  // of image pixels by ideal pixels; its determinant is positive

  /// Ideal pixels across a line of direction `ideal_unit` for one image pixel across its image: one
  /// ideal pixel each way is an area of one, areas grow by the determinant, lengths by the
  /// direction's own growth.
  double StretchAcross(const Eigen::Vector2d& ideal_unit) const {
    const double determinant = jacobian(0, 0) * jacobian(1, 1) - jacobian(0, 1) * jacobian(1, 0);
    return (jacobian * ideal_unit).norm() / determinant;
  }
};

/// Everything behind detection works in the ideal image: straight lines are straight in it. It has
/// the focal lengths of the taken one, and the size that holds all of it that can be undistorted,
/// so that its coordinates differ by whole pixels from the taken image's where the lens does
/// nothing. Plain data, no allocation.
class Rectifier {
 public:
  Rectifier() = default;  // of no camera: identity

  /// @return kInvalidArgument for an invalid camera or lens, or when nothing of the image can be
  ///         undistorted.
  static Result<Rectifier> Create(const ImageCamera& camera);

  /// True without a lens: ideal and image pixels are the same, exactly.
  bool IsIdentity() const { return mapping_.lens().IsNone(); }
  const ImageCamera& image_camera() const { return camera_; }
  const Camera& ideal() const { return ideal_; }

  /// @return nothing where the image cannot be undistorted (LensMapping::Undistort()).
  std::optional<Eigen::Vector2d> ToIdeal(const Eigen::Vector2d& image_px) const;

  /// @return nothing where the lens does not image; may lie outside of the taken image.
  std::optional<ImagePoint> ToImage(const Eigen::Vector2d& ideal_px) const;

 private:
  ImageCamera camera_;
  Camera ideal_;
  LensMapping mapping_;
};

}  // namespace plumb
