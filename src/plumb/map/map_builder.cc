#include "plumb/map/map_builder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "plumb/map/line_visibility.h"

namespace plumb {
namespace {

constexpr double kUnitTolerance = 1e-3;  // of a quaternion's norm
constexpr double kTriangulated = 0.5;    // share of the work that follows without depth images

bool IsPose(const Rigid3& pose) {
  return pose.IsFinite() && std::abs(pose.rotation.norm() - 1.0) <= kUnitTolerance;
}

Status Validate(const KeyFrameInput& frame, DepthSource depth_source) {
  const auto invalid = [&frame](const std::string& what) {
    return Error{ErrorCode::kInvalidArgument,
                 "the key frame at " + std::to_string(frame.timestamp_ns) + " ns: " + what};
  };
  if (!frame.camera.IsValid()) return invalid("the camera's intrinsics are invalid");
  if (!frame.cam_from_world.IsFinite()) return invalid("the pose is not finite");
  const double norm = frame.cam_from_world.rotation.norm();
  if (std::abs(norm - 1.0) > kUnitTolerance) {
    return invalid("the pose's quaternion has a norm of " + std::to_string(norm) + ", not 1");
  }
  if (depth_source == DepthSource::kViews) return Ok();
  if (const Status depth = frame.depth.Validate(); !depth) return invalid(depth.error().message);
  const Camera& taken =
      frame.rectifier != nullptr ? frame.rectifier->image_camera().pinhole : frame.camera;
  if (frame.depth.width_px != taken.width_px || frame.depth.height_px != taken.height_px) {
    const auto size = [](int width, int height) {
      return std::to_string(width) + " x " + std::to_string(height);
    };
    return invalid("the depth image has " + size(frame.depth.width_px, frame.depth.height_px) +
                   " px, the camera " + size(taken.width_px, taken.height_px));
  }
  return Ok();
}

}  // namespace

MapBuilder::MapBuilder(MapBuilderOptions options) : options_(std::move(options)) {}

Status MapBuilder::AddKeyFrame(KeyFrameInput frame) {
  if (const Status valid = Validate(frame, options_.depth_source); !valid) return valid.error();
  if (!timestamps_.insert(frame.timestamp_ns).second) {
    return Error{ErrorCode::kInvalidArgument,
                 "the key frame at " + std::to_string(frame.timestamp_ns) + " ns was added before"};
  }
  KeyFrame& added = key_frames_.emplace_back();
  added.timestamp_ns = frame.timestamp_ns;
  added.cam_from_world = {frame.cam_from_world.rotation.normalized(),
                          frame.cam_from_world.translation};
  added.camera = frame.camera;
  added.points = std::move(frame.points);
  ++stats_.num_key_frames;
  stats_.num_segments += frame.segments.size();
  if (options_.depth_source == DepthSource::kViews) {
    segments_.emplace_back(frame.segments.begin(), frame.segments.end());
    return Ok();
  }
  const Rigid3 world_from_cam = added.cam_from_world.Inverse();
  for (const LiftedPart& part :
       LiftSegments(frame.camera, frame.depth, frame.segments, options_.lift, frame.rectifier)) {
    added.segments.push_back(
        {part.segment_px,
         {world_from_cam * part.segment_in_cam.start, world_from_cam * part.segment_in_cam.end},
         std::nullopt});
  }
  stats_.num_lifted += added.segments.size();
  return Ok();
}

Status MapBuilder::SetPoses(std::span<const Rigid3> cam_from_world) {
  if (cam_from_world.size() != key_frames_.size() ||
      !std::all_of(cam_from_world.begin(), cam_from_world.end(), IsPose)) {
    return Error{ErrorCode::kInvalidArgument, "not one valid pose for each key frame"};
  }
  for (size_t k = 0; k < key_frames_.size(); ++k) {
    KeyFrame& frame = key_frames_[k];
    const Rigid3 pose{cam_from_world[k].rotation.normalized(), cam_from_world[k].translation};
    const Rigid3 new_from_old = pose.Inverse() * frame.cam_from_world;
    for (LiftedSegment& segment : frame.segments) {
      Segment3& lifted = segment.segment_in_world;
      lifted = {new_from_old * lifted.start, new_from_old * lifted.end};
    }
    for (MapPoint& point : frame.points) {
      point.point_in_world = (new_from_old * point.point_in_world.cast<double>()).cast<float>();
    }
    frame.cam_from_world = pose;
  }
  return Ok();
}

void MapBuilder::Triangulate(const MapBuildProgress& progress, std::vector<KeyFrame>* key_frames) {
  std::vector<SegmentView> views;
  for (size_t k = 0; k < key_frames->size(); ++k) {
    const KeyFrame& frame = (*key_frames)[k];
    views.push_back({frame.camera, frame.cam_from_world, segments_[k]});
  }
  std::vector<std::vector<LiftedSegment>> lifted =
      TriangulateSegments(views, options_.triangulation, progress);
  stats_.num_lifted = 0;
  for (size_t k = 0; k < key_frames->size(); ++k) {
    stats_.num_lifted += lifted[k].size();
    (*key_frames)[k].segments = std::move(lifted[k]);
  }
}

Result<LineMap> MapBuilder::Build(const MapBuildProgress& progress) {
  if (key_frames_.empty()) {
    return Error{ErrorCode::kInvalidArgument, "the map has no key frames"};
  }
  LineMap map;
  map.detector = options_.detector;
  map.depth_source = options_.depth_source;
  map.key_frames = key_frames_;
  LineFusionOptions fusion = options_.fusion;
  double fusion_begin = 0.0;
  if (options_.depth_source == DepthSource::kViews) {
    Triangulate(
        [&progress](double done) {
          if (progress) progress(kTriangulated * done);
        },
        &map.key_frames);
    fusion.fit.lifted_ends_count = false;
    fusion.min_key_frames = options_.triangulation.min_views;
    fusion_begin = kTriangulated;
  }
  map.lines = FuseLines(
      fusion, options_.pnp_filter, &map.key_frames,
      [&](double done) {
        if (progress) progress(fusion_begin + done * (1.0 - fusion_begin));
      },
      &stats_.num_filtered);
  ComputeVisibility(&map);
  stats_.num_lines = map.lines.size();
  stats_.num_multi_view_lines = static_cast<size_t>(
      std::count_if(map.lines.begin(), map.lines.end(),
                    [](const MapLine& line) { return line.num_observing > 1; }));
  return map;
}

}  // namespace plumb
