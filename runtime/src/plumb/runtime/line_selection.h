// Which map lines a frame is matched with: bounded lists, the most useful lines first.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/map_index.h"
#include "plumb/matching/candidate_line.h"

namespace plumb {

/// Stability of a map line, (0.3 + 0.7 min(1, 1.5 s)) min(1, n / 3), for n key frames that observed
/// it out of n / s that should have.
double LineWeight(const MapLine& line);

/// Selects lines visible from a pose. A list keeps the lines with the largest weight times visible
/// length (at most 150 px), best first, ties by id. Owns its work space and does not allocate once
/// warm; not thread-safe. Source: docs/method/association.md.
class LineSelector {
 public:
  /// `index` is borrowed.
  explicit LineSelector(const MapIndex& index) : index_(index) {}

  /// At most 300 fused lines that a camera within the prior's uncertainty may see. `id` is the
  /// map line.
  void SelectForSearch(const Camera& camera, const Rigid3& cam_from_world,
                       double rotation_sigma_rad, std::vector<CandidateLine>* out);

  /// At most 250 fused lines for the fine alignment: seen by one of the 5 nearest key frames, or by
  /// any when those are fewer than 30. `id` is the map line.
  void SelectForAlignment(const Camera& camera, const Rigid3& cam_from_world,
                          std::vector<CandidateLine>* out);

  /// At most 400 unfused lines of the 3 nearest key frames, with the covariance of their own depth
  /// and weight 1. `id` counts the segments of those key frames.
  void SelectLocal(const Camera& camera, const Rigid3& cam_from_world,
                   std::vector<CandidateLine>* out);

 private:
  struct Ranked {
    double value;
    uint32_t id;
  };
  void AppendFused(size_t max_lines, std::vector<CandidateLine>* out);
  void KeepBest(size_t max_lines);

  const MapIndex& index_;
  std::vector<VisibleLine> visible_;
  std::vector<uint32_t> key_frames_;
  std::vector<Ranked> ranked_;
};

/// The lines for the fine alignment, selected anew only for a pose far from the one before: up to 5
/// cm and 2 deg the image moves by less than the selection's margin. Not thread-safe.
class FineLines {
 public:
  /// `index` is borrowed.
  explicit FineLines(const MapIndex& index) : selector_(index) {}

  /// The next pose is of another frame.
  void Forget() { selected_at_.reset(); }

  /// LineSelector::SelectForAlignment at the pose, or at one near it. Valid until the next call.
  const std::vector<CandidateLine>& Near(const Camera& camera, const Rigid3& cam_from_world);

  /// Those of the last call.
  const std::vector<CandidateLine>& lines() const { return lines_; }

 private:
  LineSelector selector_;
  std::vector<CandidateLine> lines_;
  std::optional<Rigid3> selected_at_;
};

}  // namespace plumb
