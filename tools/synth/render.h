// Ray casting of a scene: colour, depth and which part of an edge can be seen.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "tools/synth/scene.h"

namespace plumb::synth {

struct RenderOptions {
  int samples_per_axis = 3;  // rays a pixel = square of this, 1..8
  bool shadows = true;
  double noise_grey_levels = 1.5;  // standard deviation of a pixel's noise
  uint64_t noise_seed = 0;
};

/// An RGB-D image. Depth is along the optical axis through the pixel's centre.
struct RgbdImage {
  int width_px = 0, height_px = 0;
  std::vector<uint8_t> bgr;    // [height][width][3], gamma 2.2
  std::vector<float> depth_m;  // [height][width]
};

/// Renders on all cores; the result does not depend on their number. Pixels that no ray reaches
/// through the lens stay black and without depth.
RgbdImage Render(const Scene& scene, const Rectifier& rectifier, const Rigid3& cam_from_world,
                 const RenderOptions& options);

/// Distance [m] along the ray origin + t * direction to the first surface, in units of
/// |direction|; nothing only from outside the room.
std::optional<double> CastRay(const Scene& scene, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction);

/// The parts of `edge_in_world` that the camera sees: inside the image, in front, not hidden (to
/// 1/64 of the edge's visible length), longer than `min_length_px`. Without a lens: for one, give
/// its ideal camera.
std::vector<Segment2> VisibleParts(const Scene& scene, const Camera& camera,
                                   const Rigid3& cam_from_world, const Segment3& edge_in_world,
                                   double min_length_px);

}  // namespace plumb::synth
