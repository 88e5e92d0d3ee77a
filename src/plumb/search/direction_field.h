// Directional distance field: how far is the nearest detected segment of a given orientation?
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/segment.h"

namespace plumb {

struct DirectionFieldOptions {
  int cell_px = 2;              // edge of a cell: 1, 2 or 4
  double tolerance_rad = 0.17;  // a segment is in every channel whose centre is nearer than this
};

/// Distances to the nearest segment, one byte a cell and orientation channel, truncated at 40 px.
/// Channel c holds the segments around the undirected angle (c + 0.5) pi / 16. Cells are centred on
/// the pixels that cell_px divides; a border of 20 px surrounds the image. Layout [row][column]
/// [channel], so that all channels of a cell are one vector and one pass serves them all.
/// Source: docs/method/association.md.
class DirectionField {
 public:
  static constexpr int kChannels = 16;
  static constexpr float kTruncationPx = 40.0f;

  /// 5-7 chamfer distances of `segments` in an image of the given size. No allocation once a field
  /// of this size was made.
  void Assign(int image_width_px, int image_height_px, std::span<const Segment2> segments,
              const DirectionFieldOptions& options);

  int cell_px() const { return cell_px_; }
  int border_cells() const { return border_; }
  int width() const { return width_; }    // [cells], with both borders
  int height() const { return height_; }  // [cells], with both borders
  /// Pixels per byte value.
  float unit_px() const { return 0.2f * static_cast<float>(cell_px_); }
  const uint8_t* data() const { return cells_.empty() ? nullptr : cells_.data()->data(); }

  /// Distance [px] at the cell nearest to a pixel that is not farther than the border from the
  /// image. Row and column as in data().
  float At(int row, int column, int channel) const {
    return unit_px() * static_cast<float>(cells_[Index(row, column)][channel]);
  }

 private:
  using Cell = std::array<uint8_t, kChannels>;

  size_t Index(int row, int column) const {
    return static_cast<size_t>(row) * static_cast<size_t>(width_) + static_cast<size_t>(column);
  }
  void Draw(const Segment2& segment, const Cell& keep);
  void Propagate();

  int cell_px_ = 2, border_ = 0, width_ = 0, height_ = 0;
  Cell far_{};  // of a cell that sees nothing
  std::vector<Cell> cells_;
};

}  // namespace plumb
