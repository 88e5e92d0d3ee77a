// Builds a line map from posed key frames, with depth or without: lift, fuse over the views,
// filter, visibility.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/map/depth_correction.h"
#include "plumb/map/depth_source.h"
#include "plumb/map/depth_view.h"
#include "plumb/map/lift.h"
#include "plumb/map/line_fusion.h"
#include "plumb/map/line_map.h"
#include "plumb/map/pnp_filter.h"
#include "plumb/map/triangulation.h"

namespace plumb {

struct MapBuilderOptions {
  DepthSource depth_source = DepthSource::kBoth;
  LiftOptions lift;                    // with depth images, all of one sensor
  TriangulationOptions triangulation;  // by views
  LineFusionOptions fusion;
  PnpFilterOptions pnp_filter;
  std::string detector;  // goes into the map: queries should use the same one
};

/// One posed frame. Borrowed: segments and depth must outlive AddKeyFrame() only.
struct KeyFrameInput {
  int64_t timestamp_ns = 0;
  Rigid3 cam_from_world;
  Camera camera;                         // of the segments; with a lens rectifier->ideal()
  const Rectifier* rectifier = nullptr;  // of a depth image with a lens; borrowed, too
  std::span<const Segment2> segments;    // [px], after SegmentRefiner
  DepthView depth;                       // registered to the colour image; unused without depth
  std::vector<MapPoint> points;          // optional, for the point front-end; kept as they are
};

/// What became of the segments.
struct MapBuildStats {
  size_t num_key_frames = 0;
  size_t num_segments = 0;          // given
  size_t num_lifted = 0;            // with 3D end points
  size_t num_averaged = 0;          // of those, by depth images and views that agree
  double depth_change = 0.0;        // median of |corrected / given - 1| of the depths
  size_t num_filtered = 0;          // lifted, but rejected by the PnP-RANSAC filter
  size_t num_lines = 0;             // fused
  size_t num_multi_view_lines = 0;  // of those, seen by two key frames or more
};

/// Called with the share of the work that is done, 0..1, ascending.
using MapBuildProgress = std::function<void(double done)>;

/// Add the key frames, then Build(). Needs no detector: the caller brings the segments.
/// Deterministic; not thread-safe. Memory: about 300 bytes a lifted segment.
class MapBuilder {
 public:
  explicit MapBuilder(MapBuilderOptions options = {});

  /// With depth images: lifts the frame's segments.
  /// @return kInvalidArgument, and the builder is unchanged, when the camera, the pose or the depth
  ///         image is invalid, the depth image has another size than the camera, or a frame with
  ///         this timestamp was added before. The message names the frame by its timestamp.
  Status AddKeyFrame(KeyFrameInput frame);

  /// Moves the key frames, in the order in which they were added, and all that was lifted in them.
  /// @return kInvalidArgument, and the builder is unchanged, unless there is one valid pose for
  ///         each key frame.
  Status SetPoses(std::span<const Rigid3> cam_from_world);

  /// Triangulates (unless the depth is the sensor's alone) and fuses everything added so far; may
  /// be called again after more frames or new poses. By views alone, a line has been seen by
  /// triangulation.min_views at least.
  /// @return kInvalidArgument when no key frame was added. A map without lines is not an error.
  Result<LineMap> Build(const MapBuildProgress& progress = {});

  /// The key frames as of the last Build(), without points and lines, each segment with the depth
  /// of its own depth image alone (corrected): no frame knows what another one saw. Empty where
  /// the views alone have lifted: with kViews, and where kBoth had too little depth to compare.
  std::vector<KeyFrame> KeyFramesApart() const;

  /// Of the last Build(); before it, of the frames added so far.
  const MapBuildStats& stats() const { return stats_; }

 private:
  std::vector<std::vector<TriangulatedSegment>> Triangulate(const MapBuildProgress& progress) const;
  void LiftByViews(const MapBuildProgress& progress, std::vector<KeyFrame>* key_frames) const;
  void LiftBySensor(std::vector<KeyFrame>* key_frames) const;  // with depth_fit_
  void LiftByBoth(const MapBuildProgress& progress, std::vector<KeyFrame>* key_frames);

  MapBuilderOptions options_;
  std::vector<KeyFrame> key_frames_;
  std::vector<std::vector<Segment2>> segments_;  // of the key frames
  std::vector<std::vector<LiftedPart>> parts_;   // of those, by their depth images
  std::optional<DepthFit> depth_fit_;            // of the last Build(), where depth was compared
  std::unordered_set<int64_t> timestamps_;
  MapBuildStats stats_;
};

}  // namespace plumb
