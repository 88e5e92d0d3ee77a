#include "plumb/features/duplicate_decay.h"

#include <algorithm>
#include <cstddef>

namespace plumb {
namespace {

struct Ends {
  float x[2], y[2];
};

float Squared(const Ends& a, const Ends& b, int end_of_b) {
  float sum = 0.0f;
  for (int i = 0; i < 2; ++i) {
    const float dx = a.x[i] - b.x[i ^ end_of_b], dy = a.y[i] - b.y[i ^ end_of_b];
    sum += dx * dx + dy * dy;
  }
  return sum;
}

}  // namespace

void DecayDuplicates(const DuplicateDecay& options, float cells_per_px_x, float cells_per_px_y,
                     float score_threshold, std::vector<DecodedLine>* lines) {
  if (options.decay >= 1.0f) return;
  std::vector<Ends> ends;
  ends.reserve(lines->size());
  for (const DecodedLine& line : *lines) {
    ends.push_back({{line.start_x * cells_per_px_x, line.end_x * cells_per_px_x},
                    {line.start_y * cells_per_px_y, line.end_y * cells_per_px_y}});
  }
  for (size_t i = 0; i < ends.size(); ++i) {
    for (size_t better = 0; better < i; ++better) {
      if (std::min(Squared(ends[i], ends[better], 0), Squared(ends[i], ends[better], 1)) <
          options.distance_cells2) {
        (*lines)[i].score *= options.decay;
      }
    }
  }
  std::erase_if(*lines, [&](const DecodedLine& line) { return line.score < score_threshold; });
  std::ranges::stable_sort(*lines, std::ranges::greater(), &DecodedLine::score);
}

}  // namespace plumb
