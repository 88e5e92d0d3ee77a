#include "plumb/search/direction_field.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

namespace plumb {
namespace {

constexpr int kBorderPx = 20;
// Chamfer weights; a cell is five units wide.
constexpr uint8_t kStraight = 5, kDiagonal = 7;

// All channels of a cell as one vector register.
using Vector = uint8_t __attribute__((vector_size(DirectionField::kChannels)));

Vector Load(const uint8_t* p) {
  Vector v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
void Store(const Vector& v, uint8_t* p) { std::memcpy(p, &v, sizeof(v)); }
Vector Min(const Vector& a, const Vector& b) { return a < b ? a : b; }

}  // namespace

void DirectionField::Assign(int image_width_px, int image_height_px,
                            std::span<const Segment2> segments,
                            const DirectionFieldOptions& options) {
  cell_px_ = options.cell_px;
  border_ = kBorderPx / cell_px_;
  width_ = image_width_px / cell_px_ + 2 * border_;
  height_ = image_height_px / cell_px_ + 2 * border_;
  far_.fill(static_cast<uint8_t>(kTruncationPx / unit_px() + 0.5f));
  cells_.assign(static_cast<size_t>(width_) * static_cast<size_t>(height_), far_);
  for (const Segment2& segment : segments) {
    const Eigen::Vector2d delta = segment.Delta();
    const double angle = std::atan2(delta.y(), delta.x());
    Cell keep;
    for (int c = 0; c < kChannels; ++c) {
      // Both angles are undirected: the first is within pi of zero, the second in 0..pi.
      double distance = std::abs(angle - (c + 0.5) * std::numbers::pi / kChannels);
      distance = distance < std::numbers::pi ? distance : distance - std::numbers::pi;
      distance = std::min(distance, std::numbers::pi - distance);
      keep[static_cast<size_t>(c)] = distance < options.tolerance_rad ? 0x00 : 0xff;
    }
    Draw(segment, keep);
  }
  Propagate();
}

void DirectionField::Draw(const Segment2& segment, const Cell& keep) {
  const double scale = 1.0 / cell_px_;
  const Eigen::Vector2d start = (segment.start * scale).array() + border_;
  const Eigen::Vector2d delta = segment.Delta() * scale;
  const double extent = std::max(std::abs(delta.x()), std::abs(delta.y()));
  // Written so that NaN draws nothing; far more steps than any image has cells are of no use.
  if (!(extent < 1e5)) return;
  const int steps = std::max(1, static_cast<int>(std::ceil(extent)));
  const Eigen::Vector2d step = delta / steps;
  for (int k = 0; k <= steps; ++k) {
    const double x = start.x() + k * step.x() + 0.5, y = start.y() + k * step.y() + 0.5;
    if (!(x >= 0.0 && x < width_ && y >= 0.0 && y < height_)) continue;
    uint8_t* const cell = cells_[Index(static_cast<int>(y), static_cast<int>(x))].data();
    Store(Load(cell) & Load(keep.data()), cell);
  }
}

void DirectionField::Propagate() {
  // Values never exceed the truncation, hence the sums do not overflow: 200 + 7 at most.
  const size_t stride = static_cast<size_t>(width_) * kChannels;
  uint8_t* const base = cells_.data()->data();
  const auto at = [&](int row, int column) {
    return base + static_cast<size_t>(row) * stride + static_cast<size_t>(column) * kChannels;
  };
  // The neighbours above slide through registers; only the one to the side is waited for.
  const Vector far = Load(far_.data());
  for (int row = 0; row < height_; ++row) {
    uint8_t* p = at(row, 0);
    const uint8_t* above = row > 0 ? p - stride : nullptr;
    Vector side = far, left = far, up = above ? Load(above) : far;
    for (int column = 0; column < width_; ++column) {
      const bool last = column + 1 == width_;
      const Vector right = above && !last ? Load(above + kChannels) : far;
      Vector v = Min(Load(p), Min(up + kStraight, Min(left, right) + kDiagonal));
      v = Min(v, side + kStraight);
      Store(v, p);
      side = v;
      left = up;
      up = right;
      p += kChannels;
      if (above) above += kChannels;
    }
  }
  for (int row = height_ - 1; row >= 0; --row) {
    uint8_t* p = at(row, width_ - 1);
    const uint8_t* below = row + 1 < height_ ? p + stride : nullptr;
    Vector side = far, right = far, down = below ? Load(below) : far;
    for (int column = width_ - 1; column >= 0; --column) {
      const bool last = column == 0;
      const Vector left = below && !last ? Load(below - kChannels) : far;
      Vector v = Min(Load(p), Min(down + kStraight, Min(left, right) + kDiagonal));
      v = Min(v, side + kStraight);
      Store(v, p);
      side = v;
      right = down;
      down = left;
      p -= kChannels;
      if (below) below -= kChannels;
    }
  }
}

}  // namespace plumb
