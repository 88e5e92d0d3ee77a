#include "plumb/map/triangulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "plumb/base/median.h"
#include "plumb/map/depth_hypotheses.h"
#include "plumb/map/epipolar_index.h"

namespace plumb {
namespace {

constexpr double kMinProjectedPx = 6.0;
constexpr double kClearly = 0.8;  // score of another depth over that of the best one, at most
constexpr int kAverageSteps = 2;
constexpr int kMutualPasses = 2;
constexpr int kPasses = 3;                             // the last two with measured noise
constexpr double kLeastNoise = 0.2, kMostNoise = 2.0;  // over what the options say
constexpr size_t kMinScatters = 50;
// Half of a hypothesis' variance comes from the segment's own noise, which its views share.
constexpr double kExpectedScatter = 0.5;
constexpr double kMaxLineSigmas = 3.0;  // between the lines of two segments that agree

struct Supporter {
  uint32_t view = 0, segment = 0;
};

// A segment's depths according to all views that agree, and who they are.
struct Lifted {
  std::array<double, 2> depth{}, sigma{};
  double square_scatter = 0.0;  // mean square of the views' deviations, in their standard ones
  Segment3 segment_in_world;
  std::vector<Supporter> supporters;
};

// A view with what is computed once of its segments.
struct Prepared {
  const Camera* camera = nullptr;
  Rigid3 cam_from_world;
  std::span<const Segment2> segments;
  std::vector<std::array<Eigen::Vector3d, 2>> rays;  // z = 1
  std::vector<Eigen::Vector3d> normals;              // of the planes through centre and segment
  std::vector<double> pixels;                        // distance [px] over dot product with those
  std::vector<double> lengths;                       // [px]
  std::vector<bool> usable;
};

Prepared Prepare(const SegmentView& view, double min_length_px) {
  Prepared out;
  out.camera = &view.camera;
  out.cam_from_world = view.cam_from_world;
  out.segments = view.segments;
  for (const Segment2& segment : view.segments) {
    const double length = segment.Length();
    out.rays.push_back({view.camera.Normalize(segment.start).homogeneous(),
                        view.camera.Normalize(segment.end).homogeneous()});
    const Eigen::Vector3d normal = out.rays.back()[0].cross(out.rays.back()[1]);
    out.normals.push_back(normal);
    out.pixels.push_back(1.0 /
                         std::hypot(normal.x() / view.camera.fx, normal.y() / view.camera.fy));
    out.lengths.push_back(length);
    out.usable.push_back(std::isfinite(length) && length >= min_length_px);
  }
  return out;
}

// Intersects segments of a view with those of another.
class PairTriangulator {
 public:
  PairTriangulator(const Prepared& view, const Prepared& other, uint32_t other_index,
                   const TriangulationOptions& options)
      : view_(view), other_(other), other_index_(other_index), options_(options) {
    const Rigid3 other_from_view = other.cam_from_world * view.cam_from_world.Inverse();
    rotation_ = other_from_view.RotationMatrix();
    translation_ = other_from_view.translation;
  }

  // Appends to hypotheses[i] those of the view's segment i.
  void Append(std::vector<std::vector<DepthHypothesis>>* hypotheses) const {
    const EpipolarPencil pencil(-(rotation_.transpose() * translation_));
    std::vector<std::optional<EpipolarPencil::Interval>> spans(other_.segments.size());
    for (size_t k = 0; k < spans.size(); ++k) {
      if (!other_.usable[k]) continue;
      spans[k] = pencil.Span(rotation_.transpose() * other_.rays[k][0],
                             rotation_.transpose() * other_.rays[k][1]);
    }
    const EpipolarIndex index(spans);
    std::vector<uint32_t> found;
    for (size_t i = 0; i < view_.segments.size(); ++i) {
      if (!view_.usable[i]) continue;
      const auto span = pencil.Span(view_.rays[i][0], view_.rays[i][1]);
      if (!span) continue;
      index.Find(*span, &found);
      for (const uint32_t k : found) {
        if (const auto hypothesis = Intersect(i, k)) (*hypotheses)[i].push_back(*hypothesis);
      }
    }
  }

 private:
  std::optional<DepthHypothesis> Intersect(size_t i, uint32_t k) const {
    const Segment2& segment = other_.segments[k];
    const double length = other_.lengths[k];
    const Eigen::Vector2d direction = segment.Delta() / length;
    const Eigen::Vector3d& normal = other_.normals[k];
    const Camera& camera = *other_.camera;
    const double pixels = other_.pixels[k];
    DepthHypothesis out;
    out.view = other_index_;
    out.segment = k;
    double along[2];  // of the ends' images, along the other segment [px]
    for (int end = 0; end < 2; ++end) {
      const Eigen::Vector3d ray = rotation_ * view_.rays[i][end];
      const double crossing = normal.dot(ray);
      const double depth = -normal.dot(translation_) / crossing;
      if (!(depth > options_.min_depth_m) || !std::isfinite(depth)) return std::nullopt;
      const Eigen::Vector3d in_other = depth * ray + translation_;
      if (!(in_other.z() > options_.min_depth_m)) return std::nullopt;
      along[end] = (camera.Project(in_other) - segment.start).dot(direction);
      // How far the end's image leaves the other segment's line when the depth is off, and how far
      // both segments' own noise moves it there.
      const double px_per_m = std::abs(crossing) * pixels / in_other.z();
      const double u = along[end] / length;
      const double magnified =
          depth * camera.MeanFocal() / (in_other.z() * view_.camera->MeanFocal());
      const double noise_px =
          options_.pixel_sigma_px * std::sqrt((1 - u) * (1 - u) + u * u + magnified * magnified);
      out.depth[end] = depth;
      out.sigma[end] = noise_px / px_per_m;
      if (!(out.sigma[end] < options_.max_pair_sigma * depth)) {
        return std::nullopt;
      }
    }
    const double low = std::min(along[0], along[1]), high = std::max(along[0], along[1]);
    if (high - low < kMinProjectedPx) return std::nullopt;
    const double overlap = std::min(high, length) - std::max(low, 0.0);
    if (!(overlap > options_.min_overlap * std::min(high - low, length))) return std::nullopt;
    return out;
  }

  const Prepared& view_;
  const Prepared& other_;
  uint32_t other_index_;
  const TriangulationOptions& options_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
};

DepthHypothesis Average(std::span<const DepthHypothesis* const> members) {
  DepthHypothesis mean;
  for (int end = 0; end < 2; ++end) {
    double sum = 0.0, information = 0.0;
    for (const DepthHypothesis* member : members) {
      const double weight = 1.0 / (member->sigma[end] * member->sigma[end]);
      sum += weight * member->depth[end];
      information += weight;
    }
    mean.depth[end] = sum / information;
    mean.sigma[end] = 1.0 / std::sqrt(information);
  }
  return mean;
}

// Mean square deviation from the mean, in standard deviations. At least two members.
double Scatter(const DepthHypothesis& mean, std::span<const DepthHypothesis* const> members) {
  double sum = 0.0;
  for (const DepthHypothesis* member : members) {
    for (int end = 0; end < 2; ++end) {
      const double deviation = (member->depth[end] - mean.depth[end]) / member->sigma[end];
      sum += deviation * deviation;
    }
  }
  return sum / (2.0 * (static_cast<double>(members.size()) - 1.0));
}

// Chooses among the hypotheses of one segment and averages those that agree.
std::optional<Lifted> Choose(std::span<const DepthHypothesis> hypotheses,
                             const TriangulationOptions& options) {
  const double max_square = options.max_deviation * options.max_deviation;
  DepthHypotheses table(hypotheses);
  std::vector<double> scores;
  const DepthHypothesis* best = nullptr;
  double best_score = 0.0;
  for (const DepthHypothesis& hypothesis : hypotheses) {
    double score = 0.0;
    uint32_t views = 1;
    table.ForBestOfEachView(hypothesis, max_square, [&](size_t, double square) {
      score += std::exp(-0.5 * square);
      ++views;
    });
    scores.push_back(score);
    if (views >= options.min_views && score > best_score) {
      best_score = score;
      best = &hypothesis;
    }
  }
  if (best == nullptr) return std::nullopt;
  for (size_t k = 0; k < hypotheses.size(); ++k) {
    if (scores[k] > kClearly * best_score &&
        !SquareDifferenceBelow(max_square, *best, hypotheses[k])) {
      return std::nullopt;  // another depth is as good
    }
  }

  DepthHypothesis mean = *best;
  std::vector<const DepthHypothesis*> members;
  for (int step = 0; step < kAverageSteps; ++step) {
    members.clear();
    table.ForBestOfEachView(mean, max_square,
                            [&](size_t index, double) { members.push_back(&hypotheses[index]); });
    if (members.size() + 1 < options.min_views) return std::nullopt;
    mean = Average(members);
  }
  for (int end = 0; end < 2; ++end) {
    const double limit = options.max_sigma * mean.depth[end];
    if (!(mean.sigma[end] < limit)) return std::nullopt;
  }
  Lifted out{mean.depth, mean.sigma, Scatter(mean, members), {}, {}};
  for (const DepthHypothesis* member : members) {
    out.supporters.push_back({member->view, member->segment});
  }
  return out;
}

// Do two lifted segments of different views lie on one line, where both are?
bool OnOneLine(const Lifted& a, const Lifted& b) {
  const Segment3& line = a.segment_in_world;
  const Segment3& other = b.segment_in_world;
  const Eigen::Vector3d delta = line.Delta();
  const double at_start = (other.start - line.start).dot(delta) / delta.squaredNorm();
  const double at_end = (other.end - line.start).dot(delta) / delta.squaredNorm();
  const double low = std::max(std::min(at_start, at_end), 0.0);
  const double high = std::min(std::max(at_start, at_end), 1.0);
  if (!(low < high)) return false;
  const Eigen::Vector3d other_direction = other.Delta().normalized();
  const double limit =
      kMaxLineSigmas * (std::max(a.sigma[0], a.sigma[1]) + std::max(b.sigma[0], b.sigma[1]));
  for (const double at : {low, high}) {
    const Eigen::Vector3d offset = line.start + at * delta - other.start;
    if (!(other_direction.cross(offset).norm() < limit)) return false;
  }
  return true;
}

using LiftedOfViews = std::vector<std::vector<std::optional<Lifted>>>;

// Drops segments that too few of their supporters confirm with lines of their own.
void KeepMutual(const TriangulationOptions& options, LiftedOfViews* lifted) {
  LiftedOfViews kept = *lifted;
  for (size_t v = 0; v < lifted->size(); ++v) {
    for (size_t i = 0; i < (*lifted)[v].size(); ++i) {
      const std::optional<Lifted>& own = (*lifted)[v][i];
      if (!own) continue;
      uint32_t views = 1;
      for (const Supporter& supporter : own->supporters) {
        const std::optional<Lifted>& other = (*lifted)[supporter.view][supporter.segment];
        if (other && OnOneLine(*own, *other)) ++views;
      }
      if (views < options.min_views) kept[v][i].reset();
    }
  }
  *lifted = std::move(kept);
}

using TriangulationProgress = std::function<void(double)>;

// One pass over all views with the given noise.
LiftedOfViews LiftAll(std::span<const Prepared> views,
                      std::span<const std::vector<uint32_t>> neighbours,
                      const TriangulationOptions& options, const TriangulationProgress& progress) {
  LiftedOfViews lifted(views.size());
  for (uint32_t v = 0; v < views.size(); ++v) {
    const Prepared& view = views[v];
    std::vector<std::vector<DepthHypothesis>> hypotheses(view.segments.size());
    for (const uint32_t other : neighbours[v]) {
      PairTriangulator(view, views[other], other, options).Append(&hypotheses);
    }
    lifted[v].resize(view.segments.size());
    const Rigid3 world_from_cam = view.cam_from_world.Inverse();
    for (size_t i = 0; i < view.segments.size(); ++i) {
      std::optional<Lifted>& out = lifted[v][i];
      out = Choose(hypotheses[i], options);
      if (!out) continue;
      out->segment_in_world = {world_from_cam * (out->depth[0] * view.rays[i][0]),
                               world_from_cam * (out->depth[1] * view.rays[i][1])};
    }
    progress((v + 1.0) / static_cast<double>(views.size()));
  }
  for (int pass = 0; pass < kMutualPasses; ++pass) KeepMutual(options, &lifted);
  return lifted;
}

// Median scatter of what was lifted, as a factor on the noise; nullopt when that is too little.
std::optional<double> NoiseFactor(const LiftedOfViews& lifted) {
  std::vector<double> scatter;
  for (const auto& view : lifted) {
    for (const std::optional<Lifted>& segment : view) {
      if (segment) scatter.push_back(segment->square_scatter);
    }
  }
  if (scatter.size() < kMinScatters) return std::nullopt;
  return std::sqrt(Median(scatter) / kExpectedScatter);
}

}  // namespace

std::vector<std::vector<TriangulatedSegment>> TriangulateSegments(
    std::span<const SegmentView> views, const TriangulationOptions& options,
    const TriangulationProgress& progress) {
  std::vector<Prepared> prepared;
  std::vector<Rigid3> poses;
  for (const SegmentView& view : views) {
    prepared.push_back(Prepare(view, options.min_length_px));
    poses.push_back(view.cam_from_world);
  }
  std::vector<std::vector<uint32_t>> neighbours;
  for (uint32_t v = 0; v < views.size(); ++v) {
    neighbours.push_back(ViewNeighbours(poses, v, options.neighbours));
  }

  // How well views agree tells how noisy segments and poses are; with the right noise, others
  // agree.
  TriangulationOptions used = options;
  LiftedOfViews lifted;
  for (int pass = 0; pass < kPasses; ++pass) {
    if (pass > 0) {
      const std::optional<double> factor = NoiseFactor(lifted);
      if (!factor) break;
      used.pixel_sigma_px =
          std::clamp(*factor * used.pixel_sigma_px, kLeastNoise * options.pixel_sigma_px,
                     kMostNoise * options.pixel_sigma_px);
    }
    lifted = LiftAll(prepared, neighbours, used, [&](double done) {
      if (progress) progress((pass + done) / kPasses);
    });
  }

  std::vector<std::vector<TriangulatedSegment>> out(views.size());
  for (size_t v = 0; v < views.size(); ++v) {
    for (uint32_t i = 0; i < lifted[v].size(); ++i) {
      if (const std::optional<Lifted>& segment = lifted[v][i]) {
        out[v].push_back({i, segment->depth, segment->sigma, segment->segment_in_world});
      }
    }
  }
  return out;
}

}  // namespace plumb
