#include "tools/synth/render.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "plumb/geometry/line_projection.h"
#include "tools/synth/random.h"
#include "tools/synth/texture.h"

namespace plumb::synth {
namespace {

constexpr double kFar = std::numeric_limits<double>::max();
constexpr double kSurfaceGap = 1e-4;  // [m], rays that start on a surface start this far off

/// Where a ray enters or leaves an axis-aligned box; axis = the face's normal.
struct Slab {
  double enter = -kFar, leave = kFar;
  int enter_axis = 0, leave_axis = 0;
};

Slab CrossBox(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
              const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  Slab slab;
  for (int axis = 0; axis < 3; ++axis) {
    const double inverse = 1.0 / direction[axis];  // infinite along the face: the tests still hold
    double near = (low[axis] - origin[axis]) * inverse;
    double far = (high[axis] - origin[axis]) * inverse;
    if (near > far) std::swap(near, far);
    if (near > slab.enter) slab.enter = near, slab.enter_axis = axis;
    if (far < slab.leave) slab.leave = far, slab.leave_axis = axis;
  }
  return slab;
}

struct Hit {
  double t = kFar;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Material* material = nullptr;
  double u = 0.0, v = 0.0;  // place on the surface [m]
};

Eigen::Vector3d Turn(double cosine, double sine, const Eigen::Vector3d& x) {
  return {cosine * x.x() - sine * x.y(), sine * x.x() + cosine * x.y(), x.z()};
}

/// Surface coordinates of a point on a face with normal `axis`: u horizontal, v the other one.
void SetPlace(const Eigen::Vector3d& point, int axis, Hit* hit) {
  hit->u = axis == 0 ? point.y() : point.x();
  hit->v = axis == 2 ? point.y() : point.z();
}

void CrossGroups(const Scene& scene, const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& direction, Hit* hit) {
  for (const Group& group : scene.groups) {
    const Slab bound = CrossBox(origin, direction, group.bounds.min(), group.bounds.max());
    if (bound.enter > bound.leave || bound.leave < 0.0 || bound.enter > hit->t) continue;
    for (const Box& box : group.boxes) {
      const Eigen::Vector3d from = Turn(box.cosine, -box.sine, origin - box.centre);
      const Eigen::Vector3d along = Turn(box.cosine, -box.sine, direction);
      const Slab slab = CrossBox(from, along, -box.half, box.half);
      if (slab.enter > slab.leave || slab.enter < 0.0 || slab.enter >= hit->t) continue;
      hit->t = slab.enter;
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      normal[slab.enter_axis] = along[slab.enter_axis] > 0.0 ? -1.0 : 1.0;
      hit->normal = Turn(box.cosine, box.sine, normal);
      hit->material = &box.material;
      SetPlace(from + slab.enter * along, slab.enter_axis, hit);
    }
  }
}

Hit Cast(const Scene& scene, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  Hit hit;
  const Slab room = CrossBox(origin, direction, scene.room_min, scene.room_max);
  if (room.leave > 0.0 && room.enter < 0.0) {
    hit.t = room.leave;
    const bool to_high = direction[room.leave_axis] > 0.0;
    hit.normal[room.leave_axis] = to_high ? -1.0 : 1.0;
    hit.material = room.leave_axis == 2
                       ? (to_high ? &scene.ceiling : &scene.floor)
                       : &scene.walls[static_cast<size_t>(2 * room.leave_axis + to_high)];
    SetPlace(origin + hit.t * direction, room.leave_axis, &hit);
  }
  CrossGroups(scene, origin, direction, &hit);
  return hit;
}

/// Linear light that the surface sends back: ambient, and each lamp by Lambert's law.
Eigen::Vector3f Shade(const Scene& scene, const Eigen::Vector3d& point, const Hit& hit,
                      bool shadows) {
  const Eigen::Vector3f colour = ColourAt(*hit.material, hit.u, hit.v);
  if (hit.material->glow > 0.0f) return colour * hit.material->glow;
  // Light from above is a little stronger than from below, so no two faces look alike.
  double light = 0.32 + 0.06 * hit.normal.z() + 0.03 * hit.normal.x() - 0.015 * hit.normal.y();
  for (const Eigen::Vector3d& lamp : scene.lamps) {
    const Eigen::Vector3d to_lamp = lamp - point;
    const double square = to_lamp.squaredNorm();
    const double cosine = hit.normal.dot(to_lamp) / std::sqrt(square);
    if (cosine <= 0.0) continue;
    if (shadows) {
      Hit blocker;
      blocker.t = 1.0 - 2.0 * kSurfaceGap;
      CrossGroups(scene, point + kSurfaceGap * hit.normal, to_lamp, &blocker);
      if (blocker.material != nullptr && blocker.material->glow == 0.0f) continue;
    }
    light += 3.0 * cosine / (1.0 + square);
  }
  return colour * static_cast<float>(light);
}

uint8_t ToByte(double linear, double noise) {
  const double value = 255.0 * std::pow(std::clamp(linear, 0.0, 1.0), 1.0 / 2.2) + noise;
  return static_cast<uint8_t>(std::clamp(std::lround(value), 0L, 255L));
}

/// Direction in the world of the ray through a pixel, with unit depth.
struct PixelRays {
  Eigen::Matrix3d world_from_cam;
  const Rectifier& rectifier;

  std::optional<Eigen::Vector3d> Direction(double x, double y) const {
    const std::optional<Eigen::Vector2d> ideal = rectifier.ToIdeal({x, y});
    if (!ideal) return std::nullopt;
    const Eigen::Vector2d n = rectifier.ideal().Normalize(*ideal);
    return world_from_cam * Eigen::Vector3d(n.x(), n.y(), 1.0);
  }
};

void RenderRow(const Scene& scene, const PixelRays& rays, const Eigen::Vector3d& centre,
               const RenderOptions& options, int y, RgbdImage* image) {
  const int n = options.samples_per_axis;
  Random random(Random::Mix(options.noise_seed) + static_cast<uint64_t>(y));
  for (int x = 0; x < image->width_px; ++x) {
    const size_t pixel =
        static_cast<size_t>(y) * static_cast<size_t>(image->width_px) + static_cast<size_t>(x);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (int sample = 0; sample < n * n; ++sample) {
      const double dx = (sample % n + 0.5) / n - 0.5, dy = (sample / n + 0.5) / n - 0.5;
      const std::optional<Eigen::Vector3d> direction = rays.Direction(x + dx, y + dy);
      if (!direction) continue;
      const Hit hit = Cast(scene, centre, *direction);
      if (hit.material != nullptr)
        sum += Shade(scene, centre + hit.t * *direction, hit, options.shadows);
    }
    sum /= static_cast<float>(n * n);
    for (int channel = 0; channel < 3; ++channel) {
      const double noise = options.noise_grey_levels * random.Normal();
      image->bgr[3 * pixel + static_cast<size_t>(channel)] = ToByte(sum[2 - channel], noise);
    }
    const std::optional<Eigen::Vector3d> direction = rays.Direction(x, y);
    const Hit at_centre = direction ? Cast(scene, centre, *direction) : Hit{};
    image->depth_m[pixel] = at_centre.material != nullptr ? static_cast<float>(at_centre.t) : 0.0f;
  }
}

}  // namespace

std::optional<double> CastRay(const Scene& scene, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction) {
  const Hit hit = Cast(scene, origin, direction);
  if (hit.material == nullptr) return std::nullopt;
  return hit.t;
}

RgbdImage Render(const Scene& scene, const Rectifier& rectifier, const Rigid3& cam_from_world,
                 const RenderOptions& options) {
  const Camera& camera = rectifier.image_camera().pinhole;
  RgbdImage image;
  image.width_px = camera.width_px;
  image.height_px = camera.height_px;
  const size_t pixels =
      static_cast<size_t>(camera.width_px) * static_cast<size_t>(camera.height_px);
  image.bgr.resize(3 * pixels);
  image.depth_m.resize(pixels);
  const PixelRays rays{cam_from_world.Inverse().RotationMatrix(), rectifier};
  const Eigen::Vector3d centre = cam_from_world.Center();
  const int num_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<std::jthread> threads;
  for (int t = 0; t < num_threads; ++t) {
    threads.emplace_back([&, t] {
      for (int y = t; y < camera.height_px; y += num_threads)
        RenderRow(scene, rays, centre, options, y, &image);
    });
  }
  threads.clear();  // joins
  return image;
}

std::vector<Segment2> VisibleParts(const Scene& scene, const Camera& camera,
                                   const Rigid3& cam_from_world, const Segment3& edge_in_world,
                                   double min_length_px) {
  constexpr int kSamples = 64;
  std::vector<Segment2> parts;
  const std::optional<Segment2> whole = ProjectSegment(camera, cam_from_world, edge_in_world);
  if (!whole || whole->Length() <= min_length_px) return parts;
  const Segment3 in_cam{cam_from_world * edge_in_world.start, cam_from_world * edge_in_world.end};
  const Eigen::Matrix3d world_from_cam = cam_from_world.Inverse().RotationMatrix();
  const Eigen::Vector3d centre = cam_from_world.Center();

  // Depth at a pixel of the edge: the ray's nearest approach to the edge's line.
  const auto is_visible = [&](const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d n = camera.Normalize(pixel);
    const Eigen::Vector3d ray(n.x(), n.y(), 1.0);
    const Eigen::Vector3d across = ray.cross(in_cam.Delta());
    const double depth = in_cam.start.cross(in_cam.Delta()).dot(across) / across.squaredNorm();
    const std::optional<double> first = CastRay(scene, centre, world_from_cam * ray);
    return first && *first > depth - 1e-3 * depth - 2e-3;
  };
  // A point just beside the edge may be hidden by the edge's own box, so one side is enough.
  const Eigen::Vector2d step = whole->Delta() / kSamples;
  const Eigen::Vector2d side = Eigen::Vector2d(-step.y(), step.x()).normalized() * 0.02;
  int begin = -1;
  for (int i = 0; i <= kSamples; ++i) {
    bool visible = false;
    if (i < kSamples) {
      const Eigen::Vector2d at = whole->start + (i + 0.5) * step;
      visible = is_visible(at + side) || is_visible(at - side);
    }
    if (visible && begin < 0) begin = i;
    if (!visible && begin >= 0) {
      Segment2 part{whole->start + begin * step, whole->start + i * step};
      if (part.Length() > min_length_px) parts.push_back(part);
      begin = -1;
    }
  }
  return parts;
}

}  // namespace plumb::synth
