// Where the samples of a pose fall in a direction field.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/search/direction_field.h"
#include "plumb/search/line_samples.h"

namespace plumb {

/// A pose relative to the camera that the samples belong to: x_in_cam = rotation * x + translation.
struct RelativePose {
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
  Eigen::Vector3f translation = Eigen::Vector3f::Zero();

  /// @return cam_from_world, given the pose of the camera that the samples belong to.
  Rigid3 After(const Rigid3& reference_from_world) const;
};

/// One entry a slot of the samples.
struct FieldLookups {
  std::vector<int32_t> index;        // byte in the field, always with neighbours on all sides
  std::vector<float> weight;         // of the sample; 0 outside the field or behind the camera
  std::vector<float> x, y;           // on the plane z = 1
  std::vector<float> inverse_depth;  // [1/m], depth taken as at least 0.05 m

  void Resize(size_t count);
  size_t size() const { return index.size(); }
};

/// Projects the samples; the image of a line's direction, exact to 0.004 rad, chooses the channel.
void LookUp(const Camera& camera, const DirectionField& field, const RelativePose& pose,
            const LineSamples& samples, FieldLookups* out);

}  // namespace plumb
