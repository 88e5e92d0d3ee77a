#include "plumb/map/epipolar_index.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include <Eigen/Geometry>

namespace plumb {
namespace {

constexpr double kMinSine = 0.01;  // of ray and baseline: nearer, the half-plane is noise
constexpr double kTurn = 2.0 * std::numbers::pi;

}  // namespace

EpipolarPencil::EpipolarPencil(const Eigen::Vector3d& baseline) : axis_(baseline.normalized()) {
  Eigen::Index least = 0;
  axis_.cwiseAbs().minCoeff(&least);
  across1_ = axis_.cross(Eigen::Vector3d::Unit(least)).normalized();
  across2_ = axis_.cross(across1_);
}

std::optional<EpipolarPencil::Interval> EpipolarPencil::Span(const Eigen::Vector3d& start_ray,
                                                             const Eigen::Vector3d& end_ray) const {
  double angle[2];
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector3d& ray = k == 0 ? start_ray : end_ray;
    const double x = across1_.dot(ray), y = across2_.dot(ray);
    if (!(std::hypot(x, y) > kMinSine * ray.norm())) return std::nullopt;
    angle[k] = std::atan2(y, x);
  }
  // A segment spans less than half a turn.
  const double width = std::remainder(angle[1] - angle[0], kTurn);
  const double low = width >= 0.0 ? angle[0] : angle[1];
  return Interval{low, low + std::abs(width)};
}

EpipolarIndex::EpipolarIndex(std::span<const std::optional<EpipolarPencil::Interval>> intervals) {
  for (uint32_t i = 0; i < intervals.size(); ++i) {
    if (intervals[i]) entries_.push_back({intervals[i]->low, intervals[i]->high, 0.0, i});
  }
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.low, a.index) < std::tie(b.low, b.index);
  });
  double highest = -kTurn;
  for (Entry& entry : entries_) entry.highest = highest = std::max(highest, entry.high);
}

void EpipolarIndex::Find(const EpipolarPencil::Interval& interval,
                         std::vector<uint32_t>* out) const {
  out->clear();
  // Both intervals start within one turn and are at most half a turn wide: with the interval moved
  // by a turn to either side, every overlap is met once.
  for (const double turn : {-kTurn, 0.0, kTurn}) {
    const double low = interval.low + turn, high = interval.high + turn;
    auto entry = std::lower_bound(entries_.begin(), entries_.end(), low,
                                  [](const Entry& e, double value) { return e.highest < value; });
    for (; entry != entries_.end() && entry->low <= high; ++entry) {
      if (entry->high >= low) out->push_back(entry->index);
    }
  }
}

}  // namespace plumb
