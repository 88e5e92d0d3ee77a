// What the renderer draws: a room of textured boxes. World axes: x, y on the floor, z up [m].
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/segment.h"

namespace plumb::synth {

enum class Pattern {
  kPlain,    // one colour, a faint unevenness
  kGrain,    // wood: streaks along u
  kPlanks,   // boards along u with dark gaps
  kTiles,    // square tiles with joints
  kBricks,   // running bond
  kPicture,  // overlapping rectangles, stripes and blots
  kCloth,    // fine weave with large blots
};

/// Colours are linear, 0..1. `scale_m` is the size of the pattern's repeating part.
struct Material {
  Pattern pattern = Pattern::kPlain;
  Eigen::Vector3f colour = Eigen::Vector3f::Constant(0.6f);
  Eigen::Vector3f second = Eigen::Vector3f::Constant(0.3f);
  double scale_m = 0.3;
  uint64_t seed = 0;
  float glow = 0.0f;  // light of its own, for lamps and window panes
};

/// A box turned about the vertical axis.
struct Box {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5);
  double yaw_rad = 0.0;
  Material material;
  double cosine = 1.0, sine = 0.0;  // of the yaw, set by AddBox: rays need them millions of times
};

/// Boxes that stand together, with a bound so that most rays skip them.
struct Group {
  Eigen::AlignedBox3d bounds;
  std::vector<Box> boxes;
};

struct Scene {
  /// The room's inside; its walls, floor and ceiling face inwards.
  Eigen::Vector3d room_min = Eigen::Vector3d::Zero();
  Eigen::Vector3d room_max = Eigen::Vector3d::Constant(3.0);
  Material floor, ceiling;
  std::array<Material, 4> walls;  // x min, x max, y min, y max
  std::vector<Group> groups;
  std::vector<Eigen::Vector3d> lamps;  // point lights
  /// Where the camera may move: free of furniture.
  Eigen::AlignedBox3d free_space;
};

/// Adds a box to a group and to its bound.
void AddBox(const Box& box, Group* group);

/// The 12 edges of the room and of every box, as exact 3D segments. Many are hidden from
/// everywhere; the renderer's VisibleParts() tells.
std::vector<Segment3> EdgesOf(const Scene& scene);

}  // namespace plumb::synth
