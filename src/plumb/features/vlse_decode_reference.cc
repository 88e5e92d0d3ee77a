#include "plumb/features/vlse_decode_reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace plumb {
namespace {

float Sigmoid(float x) { return 1.0f / (1.0f + std::exp(-x)); }

}  // namespace

std::vector<DecodedLine> DecodeLinesReference(std::span<const float> planes,
                                              const DecodeOptions& options, int image_width_px,
                                              int image_height_px) {
  const int width = options.width_cells, height = options.height_cells;
  const auto num_cells = static_cast<size_t>(width) * static_cast<size_t>(height);
  const auto plane = [&](size_t index, size_t cell) { return planes[index * num_cells + cell]; };
  const auto margin = [&](int x, int y) {
    const size_t cell =
        static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
    return plane(1, cell) - plane(0, cell);
  };

  std::vector<DecodedLine> lines;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float own = margin(x, y);
      bool is_maximum = true;
      for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
        for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
          is_maximum = is_maximum && own >= margin(u, v);
        }
      }
      DecodedLine line{};
      line.score = Sigmoid(own) * (is_maximum ? 1.0f : options.nms_decay);
      line.cell = static_cast<uint32_t>(y * width + x);
      if (line.score >= options.score_threshold) lines.push_back(line);
    }
  }
  std::stable_sort(lines.begin(), lines.end(),
                   [](const DecodedLine& a, const DecodedLine& b) { return a.score > b.score; });
  lines.resize(std::min(lines.size(), static_cast<size_t>(options.max_lines)));

  const float px_per_cell_x = static_cast<float>(image_width_px) / static_cast<float>(width);
  const float px_per_cell_y = static_cast<float>(image_height_px) / static_cast<float>(height);
  for (DecodedLine& line : lines) {
    const size_t cell = line.cell;
    const int column = static_cast<int>(cell) % width, row = static_cast<int>(cell) / width;
    const float x = static_cast<float>(column) + Sigmoid(plane(2, cell));
    const float y = static_cast<float>(row) + Sigmoid(plane(3, cell));
    float dx = options.displacement_scale * plane(4, cell);
    float dy = options.displacement_scale * plane(5, cell);
    if (dx < 0.0f || (dx == 0.0f && dy < 0.0f)) {
      dx = -dx;
      dy = -dy;
    }
    line.start_x = px_per_cell_x * (x - dx) - 0.5f;
    line.start_y = px_per_cell_y * (y - dy) - 0.5f;
    line.end_x = px_per_cell_x * (x + dx) - 0.5f;
    line.end_y = px_per_cell_y * (y + dy) - 0.5f;
  }
  return lines;
}

}  // namespace plumb
