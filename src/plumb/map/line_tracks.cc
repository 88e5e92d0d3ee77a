#include "plumb/map/line_tracks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "plumb/map/line_cloud.h"

namespace plumb {
namespace {

constexpr double kMinProjectedPx = 8.0;
constexpr double kDepthSlackM = 1.0;    // a line so far behind all segments of a frame is skipped
constexpr double kPxPerDoubling = 1.0;  // a line of twice the observations may lie so much farther
constexpr uint32_t kNoLine = UINT32_MAX;

bool NearInSpace(const Segment3& line, const LineObservation& observation, double margin_m) {
  const double limit = 3.0 * (observation.depth_sigma_m + margin_m);
  const Eigen::Vector3d direction = line.Delta().normalized();
  for (const Eigen::Vector3d& end :
       {observation.lifted_in_world.start, observation.lifted_in_world.end}) {
    const Eigen::Vector3d offset = end - line.start;
    if (!((offset - offset.dot(direction) * direction).norm() < limit)) return false;
  }
  return true;
}

// Finds the pairs of one frame that pass the gate, in the image and in space. Owns work space.
class FrameAssociator {
 public:
  FrameAssociator(const ObservationTable& table, const AssociationGate& gate)
      : table_(table), gate_(gate) {}

  // Cheapest pairs first: distance in the image less the line's bonus (none if `bonus_px` is
  // empty). `segment` is the index within the frame. Valid until the next call.
  std::span<const AssociationCandidate> Find(const LineCloud& lines, uint32_t frame,
                                             std::span<const double> bonus_px) {
    const SegmentsByAngle segments(table_.SegmentsOf(frame));
    lines.Project(table_.camera(frame), table_.cam_from_world(frame), kMinProjectedPx,
                  table_.max_depth_m(frame) + kDepthSlackM, &projected_);
    candidates_.clear();
    for (const ProjectedLine& line : projected_) {
      segments.AppendCandidates(line, gate_, &candidates_);
    }
    std::erase_if(candidates_, [&](const AssociationCandidate& c) {
      return !NearInSpace(lines[c.line], table_[table_.frame_begin(frame) + c.segment],
                          gate_.depth_margin_m);
    });
    const auto key = [bonus_px](const AssociationCandidate& c) {
      const double bonus = bonus_px.empty() ? 0.0 : bonus_px[c.line];
      return std::tuple(c.distance_px - bonus, c.line, c.segment);
    };
    std::sort(candidates_.begin(), candidates_.end(),
              [&key](const auto& a, const auto& b) { return key(a) < key(b); });
    return candidates_;
  }

 private:
  const ObservationTable& table_;
  const AssociationGate gate_;
  std::vector<ProjectedLine> projected_;
  std::vector<AssociationCandidate> candidates_;
};

// The line, made longer where the segment reaches beyond it.
Segment3 Extended(const Segment3& line, const Segment3& by) {
  const double length = line.Length();
  const Eigen::Vector3d direction = line.Delta() / length;
  const double a = (by.start - line.start).dot(direction);
  const double b = (by.end - line.start).dot(direction);
  return {line.start + std::min({0.0, a, b}) * direction,
          line.start + std::max({length, a, b}) * direction};
}

std::vector<LineObservation> Gather(const ObservationTable& table, const LineTrack& track) {
  std::vector<LineObservation> observations;
  observations.reserve(track.observations.size());
  for (const uint32_t id : track.observations) observations.push_back(table[id]);
  return observations;
}

// Many observations first, then by the longest of them.
std::vector<uint32_t> OrderOfTracks(const ObservationTable& table,
                                    const std::vector<LineTrack>& tracks) {
  std::vector<double> value;
  for (const LineTrack& track : tracks) {
    double longest_px = 0.0;
    for (const uint32_t id : track.observations) {
      longest_px = std::max(longest_px, table.segment_px(id).Length());
    }
    value.push_back(1000.0 * static_cast<double>(track.observations.size()) + longest_px);
  }
  std::vector<uint32_t> order(tracks.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&value](uint32_t a, uint32_t b) { return value[a] > value[b]; });
  return order;
}

}  // namespace

std::vector<LineTrack> GrowTracks(const ObservationTable& table, const AssociationGate& gate,
                                  const TrackProgress& progress) {
  LineCloud lines;
  std::vector<std::vector<uint32_t>> members;
  FrameAssociator associator(table, gate);
  for (uint32_t frame = 0; frame < table.num_frames(); ++frame) {
    const uint32_t begin = table.frame_begin(frame);
    const std::span<const Segment2> segments = table.SegmentsOf(frame);
    std::vector<bool> used(segments.size(), false);
    for (const AssociationCandidate& c : associator.Find(lines, frame, {})) {
      if (used[c.segment]) continue;
      used[c.segment] = true;
      members[c.line].push_back(begin + c.segment);
      lines.Set(c.line, Extended(lines[c.line], table[begin + c.segment].lifted_in_world));
    }
    std::vector<uint32_t> longest_first(segments.size());
    std::iota(longest_first.begin(), longest_first.end(), 0u);
    std::stable_sort(longest_first.begin(), longest_first.end(), [&](uint32_t a, uint32_t b) {
      return segments[a].Length() > segments[b].Length();
    });
    for (const uint32_t segment : longest_first) {
      if (used[segment]) continue;
      lines.Add(table[begin + segment].lifted_in_world);
      members.push_back({begin + segment});
    }
    if (progress) progress((frame + 1.0) / table.num_frames());
  }
  std::vector<LineTrack> tracks;
  tracks.reserve(members.size());
  for (size_t i = 0; i < members.size(); ++i) {
    tracks.push_back({lines[i], std::move(members[i])});
  }
  return tracks;
}

std::vector<LineTrack> SettleTracks(const ObservationTable& table, const AssociationGate& gate,
                                    std::vector<LineTrack> tracks, const TrackProgress& progress) {
  LineCloud lines;
  std::vector<double> bonus_px;
  for (const uint32_t i : OrderOfTracks(table, tracks)) {
    lines.Add(tracks[i].segment_in_world);
    const double count = static_cast<double>(tracks[i].observations.size());
    bonus_px.push_back(kPxPerDoubling * std::log2(count));
  }

  std::vector<uint32_t> owner(table.size(), kNoLine);
  FrameAssociator associator(table, gate);
  for (uint32_t frame = 0; frame < table.num_frames(); ++frame) {
    for (const AssociationCandidate& c : associator.Find(lines, frame, bonus_px)) {
      uint32_t& line = owner[table.frame_begin(frame) + c.segment];
      if (line == kNoLine) line = c.line;
    }
    if (progress) progress((frame + 1.0) / table.num_frames());
  }
  std::vector<LineTrack> settled(lines.size());
  for (size_t i = 0; i < lines.size(); ++i) settled[i].segment_in_world = lines[i];
  for (uint32_t id = 0; id < table.size(); ++id) {
    if (owner[id] != kNoLine) settled[owner[id]].observations.push_back(id);
  }
  std::erase_if(settled, [](const LineTrack& track) { return track.observations.empty(); });
  return settled;
}

std::optional<FittedLine> RefineTrack(const ObservationTable& table, const LineFitOptions& options,
                                      LineTrack* track) {
  const std::vector<LineObservation> observations = Gather(table, *track);
  std::optional<FittedLine> fitted = FitLine(track->segment_in_world, observations, options);
  if (!fitted) return std::nullopt;
  const auto [begin, end] = SupportedExtent(fitted->line.anchors_in_world, observations);
  *fitted = fitted->WithAnchors(begin, end);
  track->segment_in_world = fitted->line.anchors_in_world;
  return fitted;
}

}  // namespace plumb
