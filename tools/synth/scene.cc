#include "tools/synth/scene.h"

#include <cmath>

namespace plumb::synth {
namespace {

std::array<Eigen::Vector3d, 8> CornersOf(const Box& box) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(box.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  std::array<Eigen::Vector3d, 8> corners;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d sign((i & 1) ? 1.0 : -1.0, (i & 2) ? 1.0 : -1.0, (i & 4) ? 1.0 : -1.0);
    corners[static_cast<size_t>(i)] = box.centre + turn * box.half.cwiseProduct(sign);
  }
  return corners;
}

void AppendEdges(const std::array<Eigen::Vector3d, 8>& corners, std::vector<Segment3>* edges) {
  for (size_t corner = 0; corner < 8; ++corner) {
    for (const size_t axis : {1u, 2u, 4u}) {  // each edge once, from its end with the lower sign
      if ((corner & axis) == 0) edges->push_back({corners[corner], corners[corner | axis]});
    }
  }
}

}  // namespace

void AddBox(const Box& box, Group* group) {
  for (const Eigen::Vector3d& corner : CornersOf(box)) group->bounds.extend(corner);
  group->boxes.push_back(box);
  group->boxes.back().cosine = std::cos(box.yaw_rad);
  group->boxes.back().sine = std::sin(box.yaw_rad);
}

std::vector<Segment3> EdgesOf(const Scene& scene) {
  std::vector<Segment3> edges;
  Box room;
  room.centre = 0.5 * (scene.room_min + scene.room_max);
  room.half = 0.5 * (scene.room_max - scene.room_min);
  AppendEdges(CornersOf(room), &edges);
  for (const Group& group : scene.groups) {
    for (const Box& box : group.boxes) AppendEdges(CornersOf(box), &edges);
  }
  return edges;
}

}  // namespace plumb::synth
