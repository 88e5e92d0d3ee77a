#include "tools/synth/room.h"

#include <algorithm>
#include <numbers>

#include "tools/synth/furniture.h"
#include "tools/synth/random.h"

namespace plumb::synth {
namespace {

/// The whole of one wall; the four run counter-clockwise, so the room is to their left.
Place PlaceOnWall(const Scene& scene, int wall) {
  const Eigen::Vector3d& low = scene.room_min;
  const Eigen::Vector3d& high = scene.room_max;
  const double quarter = 0.5 * std::numbers::pi;
  switch (wall) {
    case 0:
      return {{low.x(), low.y(), 0.0}, 0.0, high.x() - low.x()};
    case 1:
      return {{high.x(), low.y(), 0.0}, quarter, high.y() - low.y()};
    case 2:
      return {{high.x(), high.y(), 0.0}, 2.0 * quarter, high.x() - low.x()};
    default:
      return {{low.x(), high.y(), 0.0}, -quarter, high.y() - low.y()};
  }
}

/// What stands or hangs in one stretch of wall.
void FurnishStretch(const Place& place, double height, Random* random, Scene* scene) {
  Group group;
  switch (random->Index(7)) {
    case 0:
      AddShelf(place, random, &group);
      break;
    case 1:
      AddTable(place, random, &group);
      break;
    case 2:
      AddCupboard(place, random, &group);
      break;
    case 3:
      AddWindow(place, height, random, &group);
      break;
    case 4:
      AddDoor(place, random, &group);
      break;
    case 5:
      AddSteps(place, random, &group);
      break;
    default:
      AddPictures(place, random, &group);
      break;
  }
  scene->groups.push_back(group);
}

}  // namespace

Scene MakeRoom(uint64_t seed) {
  Random random(Random::Mix(seed + 1));
  Scene scene;
  const double width = random.Uniform(4.0, 6.0), length = random.Uniform(3.6, 5.0);
  const double height = random.Uniform(2.4, 2.8);
  scene.room_min = Eigen::Vector3d(-0.5 * width, -0.5 * length, 0.0);
  scene.room_max = Eigen::Vector3d(0.5 * width, 0.5 * length, height);

  const Pattern floors[] = {Pattern::kPlanks, Pattern::kTiles, Pattern::kGrain};
  scene.floor = RandomMaterial(floors[random.Index(3)], 0.1, 0.45, &random);
  scene.floor.scale_m = scene.floor.pattern == Pattern::kPlanks ? 0.14 : random.Uniform(0.25, 0.5);
  scene.ceiling = RandomMaterial(Pattern::kPlain, 0.7, 0.9, &random);
  for (Material& wall : scene.walls) {
    const bool bricks = random.Chance(0.2);
    wall = RandomMaterial(bricks ? Pattern::kBricks : Pattern::kPlain, bricks ? 0.25 : 0.45, 0.8,
                          &random);
    wall.scale_m = 0.24;
  }
  for (int lamp = 0; lamp < 2; ++lamp) {
    scene.lamps.emplace_back(random.Uniform(-0.3, 0.3) * width, random.Uniform(-0.3, 0.3) * length,
                             height - 0.25);
  }

  for (int wall = 0; wall < 4; ++wall) {
    const Place whole = PlaceOnWall(scene, wall);
    Group skirting;
    AddSkirting(whole, &random, &skirting);
    scene.groups.push_back(skirting);
    // Stretches of about 1.2 m; the corners stay free, where two walls' furniture would meet.
    const double corner = 0.55, usable = whole.length_m - 2.0 * corner;
    const int stretches = std::max(1, static_cast<int>(usable / random.Uniform(1.05, 1.4)));
    for (int i = 0; i < stretches; ++i) {
      Place place = whole;
      place.length_m = usable / stretches - 0.08;
      place.origin = whole.At({corner + i * usable / stretches + 0.04, 0.0, 0.0});
      FurnishStretch(place, height, &random, &scene);
    }
  }
  const double margin = 1.05;  // deeper than any furniture, chairs included
  scene.free_space.min() = scene.room_min + Eigen::Vector3d(margin, margin, 1.1);
  scene.free_space.max() = scene.room_max - Eigen::Vector3d(margin, margin, height - 1.7);
  return scene;
}

}  // namespace plumb::synth
