// Pieces of furniture as groups of boxes, each drawn at random within sensible sizes.
#pragma once

#include <Eigen/Core>

#include "tools/synth/random.h"
#include "tools/synth/scene.h"

namespace plumb::synth {

/// A stretch of wall: x along it, y (90 deg to the left of x, seen from above) into the room, z up;
/// the origin is its start on the floor.
struct Place {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;  // of the x axis
  double length_m = 1.0;

  /// World coordinates of a point given in the frame of the place.
  Eigen::Vector3d At(const Eigen::Vector3d& point) const;
};

/// Colours of a hue drawn at random with brightness low..high.
Material RandomMaterial(Pattern pattern, double low, double high, Random* random);

void AddSkirting(const Place& place, Random* random, Group* group);
void AddShelf(const Place& place, Random* random, Group* group);     // boards, books, boxes
void AddTable(const Place& place, Random* random, Group* group);     // with chairs and clutter
void AddCupboard(const Place& place, Random* random, Group* group);  // doors, drawers, handles
void AddSteps(const Place& place, Random* random, Group* group);     // a flight of stairs
void AddDoor(const Place& place, Random* random, Group* group);
void AddWindow(const Place& place, double room_height_m, Random* random, Group* group);
void AddPictures(const Place& place, Random* random, Group* group);  // above a bench

}  // namespace plumb::synth
