#include "tools/metrics/control_segments.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace plumb::tools {
namespace {

/// A standard distribution would differ between standard libraries.
double Uniform(std::mt19937_64* random) {
  return static_cast<double>((*random)() >> 11) * 0x1.0p-53;
}

/// Where the middle of something of half size `half` may be so that it stays in [0, size - 1].
double Place(double half, int size, std::mt19937_64* random) {
  const double centre = 0.5 * (size - 1);
  const double reach = std::max(0.0, centre - half);
  return centre + (2.0 * Uniform(random) - 1.0) * reach;
}

}  // namespace

std::vector<Segment2> MirrorSegments(std::span<const Segment2> segments, int width_px) {
  std::vector<Segment2> mirrored(segments.begin(), segments.end());
  for (Segment2& segment : mirrored) {
    segment.start.x() = width_px - 1 - segment.start.x();
    segment.end.x() = width_px - 1 - segment.end.x();
  }
  return mirrored;
}

std::vector<Segment2> ScatterSegments(std::span<const Segment2> segments, int width_px,
                                      int height_px, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Segment2> scattered(segments.begin(), segments.end());
  for (Segment2& segment : scattered) {
    const double angle = std::numbers::pi * Uniform(&random);
    const Eigen::Vector2d half =
        0.5 * segment.Length() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const double x = Place(std::abs(half.x()), width_px, &random);
    const double y = Place(std::abs(half.y()), height_px, &random);
    segment.start = Eigen::Vector2d(x, y) - half;
    segment.end = Eigen::Vector2d(x, y) + half;
  }
  return scattered;
}

}  // namespace plumb::tools
