// Segments of one view by the epipolar planes that they span with another view.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/segment.h"

namespace plumb {

/// The half-planes that end in the line through two camera centres, numbered by their angle: both
/// views see a point in the same one.
class EpipolarPencil {
 public:
  /// @param baseline  From one centre to the other, in the frame of the rays to come; not zero.
  explicit EpipolarPencil(const Eigen::Vector3d& baseline);

  struct Interval {
    double low = 0.0;   // [rad], -pi .. pi
    double high = 0.0;  // low .. low + pi
  };
  /// The half-planes through a segment, given by the rays to its ends.
  /// @return nullopt when a ray is nearly parallel to the baseline: the segment touches the epipole
  ///         and says nothing.
  std::optional<Interval> Span(const Eigen::Vector3d& start_ray,
                               const Eigen::Vector3d& end_ray) const;

 private:
  Eigen::Vector3d axis_, across1_, across2_;  // unit, orthogonal
};

/// Finds the intervals that overlap another one without looking at all of them.
class EpipolarIndex {
 public:
  /// @param intervals  Those without a value are never found.
  explicit EpipolarIndex(std::span<const std::optional<EpipolarPencil::Interval>> intervals);

  /// Replaces `out` by the indices of the overlapping intervals, in a fixed order, each once.
  void Find(const EpipolarPencil::Interval& interval, std::vector<uint32_t>* out) const;

 private:
  struct Entry {
    double low, high;
    double highest;  // of this entry and all before it
    uint32_t index;
  };
  std::vector<Entry> entries_;  // by low
};

}  // namespace plumb
