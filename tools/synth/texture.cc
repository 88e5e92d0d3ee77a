#include "tools/synth/texture.h"

#include <algorithm>
#include <cmath>

#include "tools/synth/random.h"

namespace plumb::synth {
namespace {

/// [0, 1), a function of the cell alone.
double CellValue(int64_t x, int64_t y, uint64_t seed) {
  const uint64_t mixed = Random::Mix(static_cast<uint64_t>(x) * 0x9E3779B97F4A7C15ull ^
                                     Random::Mix(static_cast<uint64_t>(y) + seed));
  return static_cast<double>(mixed >> 11) * 0x1.0p-53;
}

int64_t Floor(double x) { return static_cast<int64_t>(std::floor(x)); }

/// Smooth noise in [0, 1] with one feature per unit.
double Noise(double x, double y, uint64_t seed) {
  const int64_t ix = Floor(x), iy = Floor(y);
  const double fx = x - static_cast<double>(ix), fy = y - static_cast<double>(iy);
  const double sx = fx * fx * (3.0 - 2.0 * fx), sy = fy * fy * (3.0 - 2.0 * fy);
  const double top = CellValue(ix, iy, seed) * (1.0 - sx) + CellValue(ix + 1, iy, seed) * sx;
  const double low =
      CellValue(ix, iy + 1, seed) * (1.0 - sx) + CellValue(ix + 1, iy + 1, seed) * sx;
  return top * (1.0 - sy) + low * sy;
}

/// 1 inside a joint of width `joint` at the borders of the unit cell, 0 elsewhere.
bool InJoint(double u, double v, double joint_u, double joint_v) {
  const double fu = u - std::floor(u), fv = v - std::floor(v);
  return fu < joint_u || fv < joint_v;
}

/// Picture of about a dozen rectangles, stripes and discs in a frame of scale x scale.
Eigen::Vector3f PictureAt(const Material& m, double u, double v) {
  const double x = u / m.scale_m, y = v / m.scale_m;
  Eigen::Vector3f colour = m.colour;
  for (uint64_t shape = 0; shape < 14; ++shape) {
    Random random(m.seed * 131 + shape);
    const double cx = random.Uniform(-0.6, 0.6), cy = random.Uniform(-0.6, 0.6);
    const double rx = random.Uniform(0.04, 0.35), ry = random.Uniform(0.04, 0.35);
    const double angle = random.Uniform(0.0, 3.14);
    const Eigen::Vector3f paint(static_cast<float>(random.Uniform(0.02, 0.9)),
                                static_cast<float>(random.Uniform(0.02, 0.9)),
                                static_cast<float>(random.Uniform(0.02, 0.9)));
    const double dx = std::cos(angle) * (x - cx) + std::sin(angle) * (y - cy);
    const double dy = -std::sin(angle) * (x - cx) + std::cos(angle) * (y - cy);
    const bool disc = random.Chance(0.35);
    const bool inside = disc ? dx * dx / (rx * rx) + dy * dy / (ry * ry) < 1.0
                             : std::abs(dx) < rx && std::abs(dy) < ry;
    if (inside) colour = paint;
  }
  return colour;
}

}  // namespace

Eigen::Vector3f ColourAt(const Material& m, double u, double v) {
  const double s = m.scale_m;
  // Every surface is a little uneven, at the size of a hand and of a finger.
  const auto unevenness = static_cast<float>(0.92 + 0.10 * Noise(4.0 * u, 4.0 * v, m.seed) +
                                             0.06 * Noise(40.0 * u, 40.0 * v, m.seed + 1));
  switch (m.pattern) {
    case Pattern::kPlain:
      return m.colour * unevenness;
    case Pattern::kGrain: {
      const double streak = Noise(3.0 * u / s, 60.0 * v / s, m.seed + 2);
      return unevenness * (m.colour + (m.second - m.colour) * static_cast<float>(streak * streak));
    }
    case Pattern::kPlanks: {
      const int64_t row = Floor(v / s);
      const double shifted = u / (8.0 * s) + CellValue(row, 0, m.seed);
      const double tone = 0.75 + 0.5 * CellValue(row, Floor(shifted), m.seed + 3);
      if (InJoint(shifted, v / s, 0.003 / (8.0 * s), 0.004 / s)) return 0.25f * m.second;
      const double streak = Noise(5.0 * u, 90.0 * v, m.seed + 4);
      return static_cast<float>(tone * (0.8 + 0.4 * streak)) * m.colour;
    }
    case Pattern::kTiles: {
      if (InJoint(u / s, v / s, 0.005 / s, 0.005 / s)) return m.second * unevenness;
      const double tone = 0.9 + 0.2 * CellValue(Floor(u / s), Floor(v / s), m.seed);
      return static_cast<float>(tone) * unevenness * m.colour;
    }
    case Pattern::kBricks: {
      const int64_t row = Floor(v / (0.35 * s));
      const double shifted = u / s + (row % 2 != 0 ? 0.5 : 0.0);
      if (InJoint(shifted, v / (0.35 * s), 0.01 / s, 0.01 / (0.35 * s)))
        return m.second * unevenness;
      const double tone = 0.7 + 0.6 * CellValue(row, Floor(shifted), m.seed);
      return static_cast<float>(tone) * unevenness * m.colour;
    }
    case Pattern::kPicture:
      return PictureAt(m, u, v) * unevenness;
    case Pattern::kCloth: {
      const double weave = 0.85 + 0.3 * Noise(150.0 * u, 150.0 * v, m.seed + 5);
      const bool blot = Noise(u / s, v / s, m.seed + 6) > 0.55;
      return static_cast<float>(weave) * (blot ? m.second : m.colour);
    }
  }
  return m.colour;
}

}  // namespace plumb::synth
