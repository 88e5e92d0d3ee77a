// Pairs of lines and segments that are near each other, listed once and weighed at many poses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "plumb/matching/association_gates.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// Build() looks at all pairs, Weigh() only at the list: while the pose moves little and the gates
/// only shrink, nothing is lost. Owns its memory and does not allocate once warm; not thread-safe.
class PairList {
 public:
  /// A list holds no more; what is beyond belongs to the last lines.
  static constexpr size_t kMaxPairs = 8192;

  /// Lists the pairs that are inside `gates` or would be if the image moved by `slack_px`.
  void Build(const ProjectedLines& lines, const SegmentTable& segments,
             const AssociationGates& gates, double slack_px);

  /// Keeps the listed pairs inside the gates and gives them their weight: with e = exp(-h^2 / (2
  /// sigma^2) - sin^2 / (2 sigma_sine^2)), min(e / (0.1 + sum of e over the segment's lines), 1.5 e
  /// / (0.1 + sum of e over the line's segments)). `lines` has the rows that Build() saw.
  /// Source: docs/method/association.md.
  void Weigh(const ProjectedLines& lines, const AssociationGates& gates);

  size_t num_listed() const { return num_listed_; }

  /// What Weigh() kept, in the order of the lines, then of the segments' orientation.
  struct Pairs {
    std::vector<int32_t> line, segment;  // rows of the lines and of the table
    std::vector<float> weight;           // 0..1
    std::vector<float> overlap;          // [px]
    std::vector<float> begin, end;       // the overlap's ends as parameters on the segment
    std::vector<float> x0, y0, x1, y1;   // the overlap's ends [px]
    std::vector<float> square;           // mean square distance of the ends [px^2]

    size_t size() const { return line.size(); }
    void Resize(size_t count);
  };
  const Pairs& pairs() const { return pairs_; }

 private:
  // The list, padded to a multiple of SegmentTable::kLanes: rows, with room for more than are
  // listed, and a copy of the segments.
  size_t num_listed_ = 0, num_lines_ = 0, num_segments_ = 0;
  std::vector<int32_t> line_, segment_;
  std::vector<float> goes_on_;  // 1 where the pair before has the same line, otherwise 0
  std::vector<float> x0_, y0_, x1_, y1_, direction_x_, direction_y_, length_;
  // At the pose of Weigh().
  std::vector<float> e_, overlap_, begin_, end_, square_;
  std::vector<float> line_sum_, segment_sum_;
  std::vector<int32_t> kept_;
  std::vector<int32_t> inside_;  // of Build()
  Pairs pairs_;
};

}  // namespace plumb
