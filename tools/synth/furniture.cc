#include "tools/synth/furniture.h"

#include <algorithm>
#include <cmath>

namespace plumb::synth {
namespace {

using Eigen::Vector3d;

/// A box between two corners in the frame of the place.
void Add(const Place& place, const Vector3d& low, const Vector3d& high, const Material& material,
         Group* group) {
  Box box;
  box.centre = place.At(0.5 * (low + high));
  box.half = 0.5 * (high - low);
  box.yaw_rad = place.yaw_rad;
  box.material = material;
  AddBox(box, group);
}

Material Wood(Random* random) {
  Material wood = RandomMaterial(Pattern::kGrain, 0.15, 0.5, random);
  wood.colour =
      Eigen::Vector3f(1.0f, 0.72f, 0.45f) * static_cast<float>(random->Uniform(0.25, 0.6));
  wood.second = 0.55f * wood.colour;
  wood.scale_m = 0.3;
  return wood;
}

/// Small boxes on a surface at height z between x0..x1 and y0..y1.
void AddClutter(const Place& place, double x0, double x1, double y0, double y1, double z, int count,
                Random* random, Group* group) {
  const double pitch = (x1 - x0) / count;
  for (int i = 0; i < count; ++i) {
    const double w = random->Uniform(0.3, 0.8) * pitch, d = random->Uniform(0.3, 0.8) * (y1 - y0);
    const double x = x0 + i * pitch + random->Uniform(0.0, pitch - w);
    const double y = y0 + random->Uniform(0.0, (y1 - y0) - d);
    const Pattern patterns[] = {Pattern::kPlain, Pattern::kPicture, Pattern::kCloth};
    Material material = RandomMaterial(patterns[random->Index(3)], 0.05, 0.85, random);
    material.scale_m = 0.2;
    Add(place, {x, y, z}, {x + w, y + d, z + random->Uniform(0.03, 0.3)}, material, group);
  }
}

void AddChair(const Place& place, double x, double y, Random* random, Group* group) {
  const Material wood = Wood(random);
  const double size = 0.4, seat = 0.45;
  for (const double lx : {0.0, size - 0.04}) {
    for (const double ly : {0.0, size - 0.04}) {
      const double top = ly > 0.0 ? 0.95 : seat;  // the back's legs go up
      Add(place, {x + lx, y + ly, 0.0}, {x + lx + 0.04, y + ly + 0.04, top}, wood, group);
    }
  }
  Material cloth = RandomMaterial(Pattern::kCloth, 0.1, 0.6, random);
  cloth.scale_m = 0.15;
  Add(place, {x, y, seat}, {x + size, y + size - 0.04, seat + 0.04}, cloth, group);
  for (const double z : {0.62, 0.86}) {
    Add(place, {x + 0.04, y + size - 0.03, z}, {x + size - 0.04, y + size - 0.01, z + 0.08}, wood,
        group);
  }
}

}  // namespace

Vector3d Place::At(const Vector3d& point) const {
  const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
  return origin + Vector3d(c * point.x() - s * point.y(), s * point.x() + c * point.y(), point.z());
}

Material RandomMaterial(Pattern pattern, double low, double high, Random* random) {
  Material material;
  material.pattern = pattern;
  const auto paint = [&] {
    const double brightness = random->Uniform(low, high);
    Eigen::Vector3f tint;
    for (int i = 0; i < 3; ++i)
      tint[i] = static_cast<float>(brightness * random->Uniform(0.6, 1.0));
    return tint;
  };
  material.colour = paint();
  material.second = 0.45f * paint();
  material.seed = random->Next();
  return material;
}

void AddSkirting(const Place& place, Random* random, Group* group) {
  const Material paint = RandomMaterial(Pattern::kPlain, 0.5, 0.95, random);
  Add(place, {0.0, 0.0, 0.0}, {place.length_m, 0.015, random->Uniform(0.06, 0.12)}, paint, group);
}

void AddShelf(const Place& place, Random* random, Group* group) {
  const Material wood = Wood(random);
  const double width = std::min(place.length_m, random->Uniform(0.8, 1.3)), depth = 0.3;
  const double height = random->Uniform(1.2, 2.1), board = 0.025;
  const int levels = 3 + random->Index(3);
  Add(place, {0.0, 0.0, 0.0}, {board, depth, height}, wood, group);
  Add(place, {width - board, 0.0, 0.0}, {width, depth, height}, wood, group);
  for (int level = 0; level <= levels; ++level) {
    const double z = 0.06 + (height - 0.06 - board) * level / levels;
    Add(place, {board, 0.0, z}, {width - board, depth, z + board}, wood, group);
    if (level == levels) break;
    const double room = (height - 0.06 - board) / levels - board;
    double x = board + 0.01;
    while (x < width - 0.15) {  // books, a gap or a box now and then
      const double w =
          random->Chance(0.15) ? random->Uniform(0.1, 0.14) : random->Uniform(0.02, 0.055);
      if (random->Chance(0.85)) {
        Material cover =
            RandomMaterial(w > 0.09 ? Pattern::kPicture : Pattern::kPlain, 0.03, 0.9, random);
        cover.scale_m = 0.15;
        const double h = std::min(room - 0.01, random->Uniform(0.55, 0.95) * room);
        Add(place, {x, 0.02, z + board}, {x + w, random->Uniform(0.16, 0.28), z + board + h}, cover,
            group);
      }
      x += w + 0.002;
    }
  }
}

void AddTable(const Place& place, Random* random, Group* group) {
  const Material wood = Wood(random);
  const double width = std::min(place.length_m, random->Uniform(0.9, 1.4)), depth = 0.6;
  const double height = 0.74, leg = 0.05;
  Add(place, {0.0, 0.02, height - 0.03}, {width, depth, height}, wood, group);
  Add(place, {leg, 0.06, height - 0.1}, {width - leg, 0.08, height - 0.03}, wood, group);
  for (const double x : {0.02, width - 0.02 - leg}) {
    for (const double y : {0.04, depth - 0.02 - leg}) {
      Add(place, {x, y, 0.0}, {x + leg, y + leg, height - 0.03}, wood, group);
    }
  }
  AddClutter(place, 0.05, width - 0.05, 0.06, 0.5, height, 3 + random->Index(4), random, group);
  if (random->Chance(0.7)) {  // a screen
    const double x = random->Uniform(0.1, width - 0.6);
    const Material frame = RandomMaterial(Pattern::kPlain, 0.02, 0.1, random);
    Material picture = RandomMaterial(Pattern::kPicture, 0.1, 0.7, random);
    picture.scale_m = 0.5;
    Add(place, {x, 0.14, height + 0.1}, {x + 0.5, 0.17, height + 0.42}, frame, group);
    Add(place, {x + 0.015, 0.17, height + 0.115}, {x + 0.485, 0.172, height + 0.405}, picture,
        group);
    Add(place, {x + 0.22, 0.13, height}, {x + 0.28, 0.18, height + 0.1}, frame, group);
  }
  if (random->Chance(0.7)) AddChair(place, random->Uniform(0.1, width - 0.5), 0.5, random, group);
}

void AddCupboard(const Place& place, Random* random, Group* group) {
  const Material body =
      random->Chance(0.5) ? Wood(random) : RandomMaterial(Pattern::kPlain, 0.4, 0.9, random);
  const Material handle = RandomMaterial(Pattern::kPlain, 0.02, 0.2, random);
  const double width = place.length_m, depth = random->Uniform(0.4, 0.6);
  const double height = random->Chance(0.5) ? random->Uniform(0.8, 1.0) : random->Uniform(1.7, 2.1);
  Add(place, {0.0, 0.0, 0.06}, {width, depth, height}, body, group);
  const int columns = 2 + random->Index(2), rows = height < 1.2 ? 1 + random->Index(3) : 2;
  Material front = body;
  front.colour = 1.12f * body.colour;
  const double gap = 0.006;
  for (int column = 0; column < columns; ++column) {
    for (int row = 0; row < rows; ++row) {
      const double x0 = width * column / columns + gap, x1 = width * (column + 1) / columns - gap;
      const double z0 = 0.08 + (height - 0.1) * row / rows + gap;
      const double z1 = 0.08 + (height - 0.1) * (row + 1) / rows - gap;
      Add(place, {x0, depth, z0}, {x1, depth + 0.018, z1}, front, group);
      const double x = 0.5 * (x0 + x1), z = z1 - 0.08;
      Add(place, {x - 0.07, depth + 0.018, z}, {x + 0.07, depth + 0.035, z + 0.015}, handle, group);
    }
  }
  if (height < 1.2)
    AddClutter(place, 0.05, width - 0.05, 0.05, depth - 0.05, height, 2 + random->Index(4), random,
               group);
}

void AddSteps(const Place& place, Random* random, Group* group) {
  const bool stone = random->Chance(0.5);
  Material material = stone ? RandomMaterial(Pattern::kTiles, 0.3, 0.6, random) : Wood(random);
  material.scale_m = 0.3;
  const int steps = 3 + random->Index(3);
  const double run = std::min(0.28, place.length_m / steps), rise = random->Uniform(0.15, 0.2);
  for (int i = 0; i < steps; ++i) {
    Add(place, {i * run, 0.0, 0.0}, {place.length_m, 0.7, (i + 1) * rise}, material, group);
  }
}

void AddDoor(const Place& place, Random* random, Group* group) {
  const Material frame = RandomMaterial(Pattern::kPlain, 0.6, 0.95, random);
  const Material leaf =
      random->Chance(0.5) ? Wood(random) : RandomMaterial(Pattern::kPlain, 0.5, 0.9, random);
  const double width = std::min(place.length_m - 0.2, 0.85), height = 2.02, border = 0.08;
  Add(place, {0.0, 0.0, 0.0}, {border, 0.03, height + border}, frame, group);
  Add(place, {width + border, 0.0, 0.0}, {width + 2 * border, 0.03, height + border}, frame, group);
  Add(place, {border, 0.0, height}, {width + border, 0.03, height + border}, frame, group);
  Add(place, {border, 0.0, 0.005}, {width + border, 0.012, height}, leaf, group);
  Material panel = leaf;
  panel.colour *= 0.85f;
  for (const double z : {0.2, 1.1}) {
    Add(place, {border + 0.12, 0.012, z}, {width + border - 0.12, 0.02, z + 0.75}, panel, group);
  }
  const Material metal = RandomMaterial(Pattern::kPlain, 0.05, 0.2, random);
  Add(place, {width + border - 0.16, 0.012, 1.02}, {width + border - 0.04, 0.06, 1.04}, metal,
      group);
}

void AddWindow(const Place& place, double room_height_m, Random* random, Group* group) {
  const Material frame = RandomMaterial(Pattern::kPlain, 0.6, 0.95, random);
  Material pane = RandomMaterial(Pattern::kPicture, 0.5, 0.8, random);
  pane.colour = Eigen::Vector3f(0.75f, 0.85f, 0.95f);
  pane.scale_m = 2.5;
  pane.glow = 0.8f;
  const double width = place.length_m, low = random->Uniform(0.8, 1.0);
  const double high = std::min(room_height_m - 0.25, random->Uniform(1.9, 2.3)), border = 0.06;
  Add(place, {0.0, 0.0, low}, {width, 0.01, high}, pane, group);
  Add(place, {0.0, 0.0, low - border}, {width, 0.05, low}, frame, group);
  Add(place, {0.0, 0.0, high}, {width, 0.05, high + border}, frame, group);
  const int columns = 1 + random->Index(3);
  for (int i = 0; i <= columns; ++i) {
    const double x = (width - border) * i / columns;
    Add(place, {x, 0.0, low}, {x + border, 0.05, high}, frame, group);
  }
  const double bar = low + random->Uniform(0.5, 0.75) * (high - low);
  if (random->Chance(0.6))
    Add(place, {border, 0.0, bar}, {width - border, 0.045, bar + 0.035}, frame, group);
  Add(place, {-0.03, 0.0, low - border - 0.03}, {width + 0.03, 0.2, low - border}, frame, group);
  const Material radiator = RandomMaterial(Pattern::kPlain, 0.7, 0.95, random);
  for (double x = 0.1; x < width - 0.15; x += 0.075) {
    Add(place, {x, 0.04, 0.12}, {x + 0.05, 0.11, low - 0.25}, radiator, group);
  }
}

void AddPictures(const Place& place, Random* random, Group* group) {
  const int count = 1 + random->Index(3);
  const double pitch = place.length_m / count;
  for (int i = 0; i < count; ++i) {
    const double w = random->Uniform(0.45, 0.85) * pitch,
                 h = std::min(0.9, w * random->Uniform(0.7, 1.4));
    const double x = i * pitch + 0.5 * (pitch - w), z = random->Uniform(1.15, 1.45), border = 0.035;
    const Material frame =
        random->Chance(0.5) ? Wood(random) : RandomMaterial(Pattern::kPlain, 0.02, 0.15, random);
    Material picture = RandomMaterial(Pattern::kPicture, 0.1, 0.9, random);
    picture.scale_m = std::max(w, h);
    Add(place, {x, 0.0, z}, {x + w, 0.025, z + h}, frame, group);
    Add(place, {x + border, 0.025, z + border}, {x + w - border, 0.027, z + h - border}, picture,
        group);
  }
  Material cloth = RandomMaterial(Pattern::kCloth, 0.1, 0.6, random);
  cloth.scale_m = 0.25;
  const double seat = random->Uniform(0.35, 0.5);
  Add(place, {0.05, 0.05, 0.1}, {place.length_m - 0.05, 0.5, seat}, cloth, group);
  AddClutter(place, 0.1, place.length_m - 0.1, 0.1, 0.45, seat, 1 + random->Index(3), random,
             group);
}

}  // namespace plumb::synth
