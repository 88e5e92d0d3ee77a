// Sizes and conversions of the layout p8.
#include "plumb/nn/ops/p8_layout.h"

namespace plumb::nn {
namespace {

int BlocksOfRow(const Feature& feature) { return P8RoundUp(feature.width, kP8Block) / kP8Block; }

int GroupsOfBlocks(int blocks) { return P8RoundUp(blocks, kP8Lanes) / kP8Lanes; }

}  // namespace

int P8Groups(const Feature& feature) {
  return GroupsOfBlocks(feature.height * BlocksOfRow(feature));
}

int P8TileGroups(const Feature& feature) {
  const int tile_rows = P8RoundUp(feature.height, kP8TileRows) / kP8TileRows;
  return GroupsOfBlocks(tile_rows * BlocksOfRow(feature));
}

size_t P8Size(const Feature& feature) {
  Feature padded = feature;
  padded.height = P8RoundUp(feature.height, kP8TileRows);
  return static_cast<size_t>(P8Groups(padded)) * kP8Lanes * feature.channels * kP8Block;
}

std::vector<float> PlanarToP8(const Feature& feature, std::span<const float> planar) {
  std::vector<float> p8(P8Size(feature), 0.0f);
  const int blocks = BlocksOfRow(feature);
  for (int c = 0; c < feature.channels; ++c) {
    for (int y = 0; y < feature.height; ++y) {
      for (int x = 0; x < feature.width; ++x) {
        const size_t block = static_cast<size_t>(y) * blocks + x / kP8Block;
        p8[(block * feature.channels + c) * kP8Block + x % kP8Block] =
            planar[(static_cast<size_t>(c) * feature.height + y) * feature.width + x];
      }
    }
  }
  return p8;
}

std::vector<float> P8ToPlanar(const Feature& feature, std::span<const float> p8) {
  std::vector<float> planar(static_cast<size_t>(feature.channels) * feature.height * feature.width);
  const int blocks = BlocksOfRow(feature);
  for (int c = 0; c < feature.channels; ++c) {
    for (int y = 0; y < feature.height; ++y) {
      for (int x = 0; x < feature.width; ++x) {
        const size_t block = static_cast<size_t>(y) * blocks + x / kP8Block;
        planar[(static_cast<size_t>(c) * feature.height + y) * feature.width + x] =
            p8[(block * feature.channels + c) * kP8Block + x % kP8Block];
      }
    }
  }
  return planar;
}

}  // namespace plumb::nn
