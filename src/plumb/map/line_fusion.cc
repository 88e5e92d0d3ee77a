#include "plumb/map/line_fusion.h"

#include <optional>
#include <utility>

#include "plumb/map/line_tracks.h"
#include "plumb/map/observation_table.h"
#include "plumb/map/track_filter.h"

namespace plumb {
namespace {

// Shares of the work, measured on a map of 50 key frames.
constexpr double kGrown = 0.25, kRefined = 0.3, kSettled = 0.6, kFiltered = 0.95;

uint32_t CountFrames(const ObservationTable& table, const std::vector<uint32_t>& observations) {
  uint32_t count = 0;
  for (size_t i = 0; i < observations.size(); ++i) {  // grouped by frame
    count += i == 0 || table.frame_of(observations[i]) != table.frame_of(observations[i - 1]);
  }
  return count;
}

MapLine MakeMapLine(const ObservationTable& table, const LineTrack& track,
                    const FittedLine& fitted) {
  MapLine line;
  line.segment_in_world = track.segment_in_world;
  line.covariance_start = fitted.CovarianceOfStart();
  line.covariance_end = fitted.CovarianceOfEnd();
  line.num_observing = CountFrames(table, track.observations);
  line.num_expected = line.num_observing;
  return line;
}

}  // namespace

std::vector<MapLine> FuseLines(const LineFusionOptions& options, const PnpFilterOptions& filter,
                               std::vector<KeyFrame>* key_frames,
                               const std::function<void(double)>& progress, size_t* out_rejected) {
  const auto part = [&progress](double begin, double end) {
    return TrackProgress([&progress, begin, end](double done) {
      if (progress) progress(begin + done * (end - begin));
    });
  };
  const ObservationTable table(*key_frames, options.depth_noise);
  std::vector<LineTrack> tracks = GrowTracks(table, options.grow, part(0.0, kGrown));
  for (LineTrack& track : tracks) RefineTrack(table, options.fit, &track);
  if (progress) progress(kRefined);

  tracks = SettleTracks(table, options.settle, std::move(tracks), part(kRefined, kSettled));
  size_t num_rejected = 0;
  if (filter.enabled) {
    for (LineTrack& track : tracks) RefineTrack(table, options.fit, &track);
    num_rejected = FilterTracks(table, options.fit, filter, &tracks).size();
    if (progress) progress(kFiltered);
  }
  if (out_rejected != nullptr) *out_rejected = num_rejected;

  for (KeyFrame& frame : *key_frames) {
    for (LiftedSegment& segment : frame.segments) segment.line.reset();
  }
  std::vector<MapLine> lines;
  for (LineTrack& track : tracks) {
    if (CountFrames(table, track.observations) < options.min_key_frames) continue;
    const std::optional<FittedLine> fitted = RefineTrack(table, options.fit, &track);
    if (!fitted) continue;
    for (const uint32_t id : track.observations) {
      const uint32_t frame = table.frame_of(id);
      (*key_frames)[frame].segments[id - table.frame_begin(frame)].line =
          static_cast<uint32_t>(lines.size());
    }
    lines.push_back(MakeMapLine(table, track, *fitted));
  }
  if (progress) progress(1.0);
  return lines;
}

}  // namespace plumb
