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

/// All detections, best score first, and the number of lines that they could hit.
struct Ranking {
  std::vector<Judged> judged;
  double num_annotated = 0.0;
};

Ranking Rank(std::span<const LineEvaluation> images, double threshold) {
  Ranking ranking;
  for (const LineEvaluation& image : images) {
    ranking.num_annotated += static_cast<double>(image.annotated.size());
    JudgeImage(image, threshold, &ranking.judged);
  }
  std::stable_sort(ranking.judged.begin(), ranking.judged.end(),
                   [](const Judged& a, const Judged& b) { return a.score > b.score; });
  return ranking;
}

}  // namespace

double StructuralAp(std::span<const LineEvaluation> images, double threshold) {
  const auto [judged, num_annotated] = Rank(images, threshold);
  if (num_annotated == 0.0) return 0.0;
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
  return 100.0 * area / num_annotated;
}

std::vector<OperatingPoint> StructuralCurve(std::span<const LineEvaluation> images,
                                            double threshold) {
  const auto [judged, num_annotated] = Rank(images, threshold);
  std::vector<OperatingPoint> curve(101);
  size_t count = 0;
  double num_hits = 0.0;
  for (int step = 100; step >= 0; --step) {
    OperatingPoint& point = curve[step];
    point.min_score = step / 100.0;
    for (; count < judged.size() && judged[count].score >= point.min_score; ++count) {
      num_hits += judged[count].hit ? 1.0 : 0.0;
    }
    point.precision = count > 0 ? num_hits / static_cast<double>(count) : 1.0;
    point.recall = num_annotated > 0.0 ? num_hits / num_annotated : 0.0;
    const double sum = point.precision + point.recall;
    point.f = sum > 0.0 ? 2.0 * point.precision * point.recall / sum : 0.0;
  }
  return curve;
}

}  // namespace plumb::tools
