// Structural average precision (sAP) of line detectors, the protocol of L-CNN.
#include "tools/metrics/structural_ap.h"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace plumb::tools {
namespace {

constexpr double kGrid = 128.0;

struct Judged {
  double score = 0.0;
  bool hit = false;
};

double SquaredEndDistance(const Segment2& a, const Segment2& b, const Eigen::Vector2d& scale) {
  const auto squared = [&](const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
    return (p - q).cwiseProduct(scale).squaredNorm();
  };
  return std::min(squared(a.start, b.start) + squared(a.end, b.end),
                  squared(a.start, b.end) + squared(a.end, b.start));
}

void JudgeImage(const LineEvaluation& image, double threshold, std::vector<Judged>* out_judged) {
  const Eigen::Vector2d scale(kGrid / image.width_px, kGrid / image.height_px);
  std::vector<const Segment2*> ranked;
  for (const Segment2& segment : image.detected) ranked.push_back(&segment);
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Segment2* a, const Segment2* b) { return a->score > b->score; });
  std::vector<bool> taken(image.annotated.size(), false);
  for (const Segment2* segment : ranked) {
    double best = std::numeric_limits<double>::infinity();
    size_t nearest = 0;
    for (size_t i = 0; i < image.annotated.size(); ++i) {
      const double distance = SquaredEndDistance(*segment, image.annotated[i], scale);
      if (distance < best) {
        best = distance;
        nearest = i;
      }
    }
    const bool hit = best < threshold && !taken[nearest];
    if (hit) taken[nearest] = true;
    out_judged->push_back({segment->score, hit});
  }
}

}  // namespace

double StructuralAp(std::span<const LineEvaluation> images, double threshold) {
  size_t num_annotated = 0;
  std::vector<Judged> judged;
  for (const LineEvaluation& image : images) {
    num_annotated += image.annotated.size();
    JudgeImage(image, threshold, &judged);
  }
  if (num_annotated == 0) return 0.0;
  std::stable_sort(judged.begin(), judged.end(),
                   [](const Judged& a, const Judged& b) { return a.score > b.score; });
  std::vector<double> precision(judged.size());
  double num_hits = 0.0;
  for (size_t i = 0; i < judged.size(); ++i) {
    num_hits += judged[i].hit ? 1.0 : 0.0;
    precision[i] = num_hits / static_cast<double>(i + 1);
  }
  // Recall rises by 1 / num_annotated at every hit; the envelope is the best precision from there
  // on.
  double area = 0.0, envelope = 0.0;
  for (size_t i = judged.size(); i-- > 0;) {
    envelope = std::max(envelope, precision[i]);
    if (judged[i].hit) area += envelope;
  }
  return 100.0 * area / static_cast<double>(num_annotated);
}

}  // namespace plumb::tools
