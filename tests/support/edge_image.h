// Synthetic images whose edges are known exactly.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "plumb/features/image_view.h"
#include "plumb/features/luminance.h"
#include "plumb/geometry/segment.h"

namespace plumb::testing {

/// 8-bit grey image to draw into, with views of it.
struct GrayImage {
  int width_px = 0, height_px = 0;
  std::vector<uint8_t> pixels;

  GrayImage(int width, int height, uint8_t value = 0)
      : width_px(width),
        height_px(height),
        pixels(static_cast<size_t>(width) * static_cast<size_t>(height), value) {}

  uint8_t& At(int x, int y) {
    return pixels[static_cast<size_t>(y) * static_cast<size_t>(width_px) + static_cast<size_t>(x)];
  }
  GrayView Gray() const { return {pixels.data(), width_px, width_px, height_px}; }
  ImageView View() const {
    ImageView view;
    view.width_px = width_px;
    view.height_px = height_px;
    view.planes[0] = {pixels.data(), width_px};
    return view;
  }
};

/// Rectangle of any orientation whose borders are steps under a small blur (sigma 0.5 px).
struct SoftRectangle {
  Eigen::Vector2d centre, half_size;
  double angle_rad = 0.0;
  double inside = 200.0, outside = 50.0;  // grey levels

  Eigen::Vector2d Axis(int i) const {
    const Eigen::Vector2d x(std::cos(angle_rad), std::sin(angle_rad));
    return i == 0 ? x : Eigen::Vector2d(-x.y(), x.x());
  }
  Eigen::Vector2d Corner(double x, double y) const {
    return centre + x * half_size.x() * Axis(0) + y * half_size.y() * Axis(1);
  }
  /// The borders: top, right, bottom, left in the rectangle's own frame.
  std::array<Segment2, 4> Borders() const {
    const std::array<Eigen::Vector2d, 4> c = {Corner(-1, -1), Corner(1, -1), Corner(1, 1),
                                              Corner(-1, 1)};
    return {Segment2{c[0], c[1]}, Segment2{c[1], c[2]}, Segment2{c[2], c[3]}, Segment2{c[3], c[0]}};
  }
  void Draw(GrayImage* image) const {
    const auto step = [](double d) { return 0.5 * std::erfc(-d / (0.5 * std::sqrt(2.0))); };
    for (int y = 0; y < image->height_px; ++y) {
      for (int x = 0; x < image->width_px; ++x) {
        const Eigen::Vector2d p = Eigen::Vector2d(x, y) - centre;
        const double u = p.dot(Axis(0)), v = p.dot(Axis(1));
        const double cover = step(half_size.x() - std::abs(u)) * step(half_size.y() - std::abs(v));
        image->At(x, y) = static_cast<uint8_t>(std::lround(outside + (inside - outside) * cover));
      }
    }
  }
};

/// The larger distance of the ends of `segment` from the infinite line through `line` [px].
inline double DistanceFromLine(const Segment2& segment, const Segment2& line) {
  const Eigen::Vector2d unit = line.Delta().normalized();
  const auto distance = [&](const Eigen::Vector2d& p) {
    const Eigen::Vector2d d = p - line.start;
    return std::abs(unit.x() * d.y() - unit.y() * d.x());
  };
  return std::max(distance(segment.start), distance(segment.end));
}

}  // namespace plumb::testing
