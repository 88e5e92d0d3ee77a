// Pixel metrics F^H and AP^H of line detectors: the lines drawn and compared as pixels.
#include "tools/metrics/pixel_ap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tools/metrics/line_raster.h"
#include "tools/metrics/pixel_matcher.h"

namespace plumb::tools {
namespace {

constexpr double kReach = 0.01;  // of the image's diagonal
constexpr int kThresholds = 49;  // 0.98, 0.96 .. 0.02

double ThresholdAt(int step) { return (kThresholds - step) / 50.0; }

/// Pixel counts of one score threshold, summed over images.
struct PixelCounts {
  double matched = 0.0, drawn = 0.0, annotated = 0.0;
};

void CountImage(const LineEvaluation& image, std::array<PixelCounts, kThresholds>* counts) {
  PixelMatcher matcher(image.width_px, image.height_px,
                       kReach * std::hypot(image.width_px, image.height_px));
  std::vector<Eigen::Vector2i> pixels;
  for (const Segment2& line : image.annotated) {
    RasterizeLine(line, image.width_px, image.height_px, &pixels);
    for (const Eigen::Vector2i& pixel : pixels) matcher.AddTarget(pixel);
  }
  std::vector<const Segment2*> ranked;
  for (const Segment2& segment : image.detected) ranked.push_back(&segment);
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Segment2* a, const Segment2* b) { return a->score > b->score; });
  size_t next = 0;
  for (int step = 0; step < kThresholds; ++step) {
    for (; next < ranked.size() && ranked[next]->score >= ThresholdAt(step); ++next) {
      RasterizeLine(*ranked[next], image.width_px, image.height_px, &pixels);
      for (const Eigen::Vector2i& pixel : pixels) matcher.AddCandidate(pixel);
    }
    PixelCounts& sum = (*counts)[step];
    sum.matched += static_cast<double>(matcher.num_matches());
    sum.drawn += static_cast<double>(matcher.num_candidates());
    sum.annotated += static_cast<double>(matcher.num_targets());
  }
}

}  // namespace

PixelScores EvaluatePixels(std::span<const LineEvaluation> images) {
  std::array<PixelCounts, kThresholds> counts{};
  for (const LineEvaluation& image : images) CountImage(image, &counts);
  PixelScores scores;
  double envelope = 0.0, recall_after = 0.0;
  for (int step = kThresholds - 1; step >= 0; --step) {
    const PixelCounts& sum = counts[step];
    const double precision = sum.drawn > 0.0 ? sum.matched / sum.drawn : 0.0;
    const double recall = sum.annotated > 0.0 ? sum.matched / sum.annotated : 0.0;
    if (precision + recall > 0.0) {
      scores.f_percent =
          std::max(scores.f_percent, 100.0 * 2.0 * precision * recall / (precision + recall));
    }
    // Recall falls with the threshold's rise: from here up to the last one's the envelope holds.
    if (step < kThresholds - 1) scores.ap_percent += 100.0 * (recall_after - recall) * envelope;
    envelope = std::max(envelope, precision);
    recall_after = recall;
  }
  scores.ap_percent += 100.0 * recall_after * envelope;
  return scores;
}

}  // namespace plumb::tools
