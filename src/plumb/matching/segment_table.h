// A frame's segments, sorted by orientation for fast pairing with projected lines.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/segment.h"

namespace plumb {

/// Parallel arrays, ascending in `angle`; ties keep the order of the input. All but `source` and
/// `angle` are followed by kLanes rows of padding that overlap nothing, so that loops over a range
/// may run on to a multiple of kLanes.
class SegmentTable {
 public:
  static constexpr uint32_t kLanes = 8;

  /// Half-open range of rows.
  struct Range {
    uint32_t begin = 0, end = 0;
  };

  /// Takes the segments; those without length are left out. No allocation once the capacity
  /// suffices.
  void Assign(std::span<const Segment2> segments);

  size_t size() const { return source.size(); }

  /// Rows whose direction makes an angle of at most asin(max_sine) with `angle` (in [0, pi)), as up
  /// to two ranges; the second is empty when the angles do not wrap around.
  std::array<Range, 2> NearAngle(float angle, float max_sine) const;
  /// The same for a half width in radians; rounding is the caller's. Rows up to pi / 512 beyond it
  /// may come along, since the table knows where its rows are only so finely.
  std::array<Range, 2> Within(float angle, float half_width_rad) const;

  std::vector<uint32_t> source;                 // index into the input
  std::vector<float> x0, y0, x1, y1;            // end points [px]
  std::vector<float> direction_x, direction_y;  // unit
  std::vector<float> length;                    // [px]
  std::vector<float> angle;                     // [0, pi)

 private:
  static constexpr size_t kBins = 512;  // of the angle
  static size_t BinOf(float angle);

  std::vector<float> unsorted_;                     // angles in the order of the input
  std::array<uint32_t, kBins + 1> bin_begin_ = {};  // first row of a bin
};

}  // namespace plumb
