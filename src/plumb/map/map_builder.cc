#include "plumb/map/map_builder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "plumb/map/depth_correction.h"
#include "plumb/map/lift_fusion.h"
#include "plumb/map/line_visibility.h"

namespace plumb {
namespace {

constexpr double kUnitTolerance = 1e-3;  // of a quaternion's norm
constexpr double kTriangulated = 0.5;    // share of the work

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

void CorrectPoints(const DepthCorrection& correction, const Rigid3& cam_from_world,
                   std::vector<MapPoint>* points) {
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  for (MapPoint& point : *points) {
    const Eigen::Vector3d in_cam = cam_from_world * point.point_in_world.cast<double>();
    const Eigen::Vector2d ray = in_cam.hnormalized();
    const double inverse_depth = correction(ray, 1.0 / in_cam.z());
    point.point_in_world = (world_from_cam * (ray.homogeneous() / inverse_depth)).cast<float>();
  }
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
  segments_.emplace_back(frame.segments.begin(), frame.segments.end());
  if (options_.depth_source == DepthSource::kViews) return Ok();
  parts_.push_back(
      LiftSegments(frame.camera, frame.depth, frame.segments, options_.lift, frame.rectifier));
  stats_.num_lifted += parts_.back().size();
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
    for (MapPoint& point : frame.points) {
      point.point_in_world = (new_from_old * point.point_in_world.cast<double>()).cast<float>();
    }
    frame.cam_from_world = pose;
  }
  return Ok();
}

std::vector<std::vector<TriangulatedSegment>> MapBuilder::Triangulate(
    const MapBuildProgress& progress) const {
  std::vector<SegmentView> views;
  for (size_t k = 0; k < key_frames_.size(); ++k) {
    const KeyFrame& frame = key_frames_[k];
    views.push_back({frame.camera, frame.cam_from_world, segments_[k]});
  }
  return TriangulateSegments(views, options_.triangulation, progress);
}

void MapBuilder::LiftByViews(const MapBuildProgress& progress,
                             std::vector<KeyFrame>* key_frames) const {
  const std::vector<std::vector<TriangulatedSegment>> by_views = Triangulate(progress);
  for (size_t k = 0; k < key_frames->size(); ++k) {
    for (const TriangulatedSegment& segment : by_views[k]) {
      (*key_frames)[k].segments.push_back(
          {segments_[k][segment.source], segment.segment_in_world, std::nullopt});
    }
  }
}

void MapBuilder::LiftBySensor(std::vector<KeyFrame>* key_frames) const {
  const DepthFit fit = depth_fit_.value_or(DepthFit{});
  for (size_t k = 0; k < key_frames->size(); ++k) {
    KeyFrame& frame = (*key_frames)[k];
    frame.segments = FuseLifts({frame.cam_from_world, segments_[k], parts_[k], {}}, fit);
  }
}

void MapBuilder::LiftByBoth(const MapBuildProgress& progress, std::vector<KeyFrame>* key_frames) {
  const std::vector<std::vector<TriangulatedSegment>> by_views = Triangulate(progress);
  std::vector<FrameLifts> lifts;
  for (size_t k = 0; k < key_frames->size(); ++k) {
    lifts.push_back({(*key_frames)[k].cam_from_world, segments_[k], parts_[k], by_views[k]});
  }
  const DepthNoise& noise = options_.fusion.depth_noise;
  depth_fit_ = FitDepthCorrection(CompareDepths(lifts), noise);
  // With too little depth to compare, it stays as it is beside the views.
  const DepthFit fit = depth_fit_.value_or(DepthFit{});
  stats_.depth_change = fit.median_change;
  for (size_t k = 0; k < key_frames->size(); ++k) {
    KeyFrame& frame = (*key_frames)[k];
    frame.segments = FuseLifts(lifts[k], fit, noise, &stats_.num_averaged);
    if (depth_fit_) CorrectPoints(fit.correction, frame.cam_from_world, &frame.points);
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
  const auto triangulated = [&progress](double done) {
    if (progress) progress(kTriangulated * done);
  };
  depth_fit_.reset();
  stats_.num_averaged = 0;
  stats_.depth_change = 0.0;
  switch (options_.depth_source) {
    case DepthSource::kSensor:
      LiftBySensor(&map.key_frames);
      break;
    case DepthSource::kBoth:
      LiftByBoth(triangulated, &map.key_frames);
      break;
    case DepthSource::kViews:
      LiftByViews(triangulated, &map.key_frames);
      fusion.fit.lifted_ends_count = false;
      fusion.min_key_frames = options_.triangulation.min_views;
  }
  stats_.num_lifted = 0;
  for (const KeyFrame& frame : map.key_frames) stats_.num_lifted += frame.segments.size();
  const double fusion_begin = options_.depth_source == DepthSource::kSensor ? 0.0 : kTriangulated;
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

std::vector<KeyFrame> MapBuilder::KeyFramesApart() const {
  std::vector<KeyFrame> apart;
  if (options_.depth_source == DepthSource::kViews) return apart;
  if (options_.depth_source == DepthSource::kBoth && !depth_fit_) return apart;
  for (const KeyFrame& frame : key_frames_) {
    apart.push_back({frame.timestamp_ns, frame.cam_from_world, frame.camera, {}, {}});
  }
  LiftBySensor(&apart);
  return apart;
}

}  // namespace plumb
