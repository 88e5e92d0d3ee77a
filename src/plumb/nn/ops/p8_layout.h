// The layout p8 of the kernel family cpu-simd: blocks of 8 pixels of a row.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/nn/layer_plan.h"

namespace plumb::nn {

/// [row][block of 8 columns][channel][8] fp32. Rows are padded with zeros to whole blocks; buffers
/// have room for whole groups of 4 rows and of 8 blocks, since lanes behind the last block write as
/// well.
inline constexpr int kP8Block = 8;  ///< Pixels of a block.
inline constexpr int kP8Lanes = 8;  ///< Lanes, and so blocks or tiles, of a workgroup.
inline constexpr int kP8TileRows =
    4;  ///< Rows of a block that a lane of the Winograd kernel makes.

/// `value` rounded up to a multiple.
constexpr int P8RoundUp(int value, int multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

/// Workgroups of a kernel whose lanes own a block, and of one whose lanes own a block of 4 rows.
int P8Groups(const Feature& feature);
int P8TileGroups(const Feature& feature);

/// Floats of a feature in this layout.
size_t P8Size(const Feature& feature);

/// Conversions, for tests and tools.
std::vector<float> PlanarToP8(const Feature& feature, std::span<const float> planar);
std::vector<float> P8ToPlanar(const Feature& feature, std::span<const float> p8);

}  // namespace plumb::nn
