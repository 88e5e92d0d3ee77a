#include "plumb/map/map_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/box_tree.h"

namespace plumb {
namespace {

/// Where a camera with an enlarged image can see: planes with normal . x + offset >= 0 inside.
/// Rounding is taken care of by `slack`, so that nothing that ProjectSegment() shows is lost.
class Frustum {
 public:
  Frustum(const Camera& camera, const Rigid3& cam_from_world, double margin_px) {
    const double right = camera.width_px - 1 + margin_px, bottom = camera.height_px - 1 + margin_px;
    // fx x / z + cx >= -margin for z > 0, and so on.
    const std::array<Eigen::Vector3d, 5> normals_in_cam = {
        Eigen::Vector3d(camera.fx, 0.0, camera.cx + margin_px),
        Eigen::Vector3d(-camera.fx, 0.0, right - camera.cx),
        Eigen::Vector3d(0.0, camera.fy, camera.cy + margin_px),
        Eigen::Vector3d(0.0, -camera.fy, bottom - camera.cy),
        Eigen::Vector3d(0.0, 0.0, 1.0),
    };
    const Eigen::Matrix3d world_from_cam = cam_from_world.RotationMatrix().transpose();
    for (size_t i = 0; i < normals_.size(); ++i) {
      const Eigen::Vector3d normal = normals_in_cam[i].normalized();
      normals_[i] = world_from_cam * normal;
      offsets_[i] = normal.dot(cam_from_world.translation);
    }
    offsets_.back() -= kNearPlane;
    slack_ = 1e-9 * (1.0 + cam_from_world.translation.norm());
  }

  /// Whether no plane has the whole segment outside.
  bool MayContain(const Segment3& segment) const {
    for (size_t i = 0; i < normals_.size(); ++i) {
      const double a = normals_[i].dot(segment.start), b = normals_[i].dot(segment.end);
      if (std::max(a, b) + offsets_[i] < -slack_) return false;
    }
    return true;
  }

  bool MayContain(const Box& box) const {
    for (size_t i = 0; i < normals_.size(); ++i) {
      if (box.Support(normals_[i]) + offsets_[i] < -slack_) return false;
    }
    return true;
  }

 private:
  std::array<Eigen::Vector3d, 5> normals_;
  std::array<double, 5> offsets_ = {};
  double slack_ = 0.0;
};

/// What decides whether a line is visible.
struct Entry {
  Segment3 segment;
  uint32_t line = 0;
  uint32_t num_observing = 0;
  uint32_t sightings_begin = 0, sightings_end = 0;
};

/// Whether one camera sees a line, or may see something of a box of lines.
class ViewTest {
 public:
  /// @param key_frames  Whose sightings count, borrowed; none: all.
  ViewTest(const Camera& camera, const Rigid3& cam_from_world, const VisibilityOptions& options,
           std::span<const LineSighting> sightings, std::span<const uint32_t> key_frames)
      : camera_(camera),
        options_(options),
        sightings_(sightings),
        key_frames_(key_frames),
        frustum_(camera, cam_from_world, options.margin_px),
        rotation_(cam_from_world.RotationMatrix()),
        translation_(cam_from_world.translation),
        center_(cam_from_world.Center()),
        min_cosine_(options.max_view_angle_rad < std::numbers::pi
                        ? std::cos(options.max_view_angle_rad)
                        : -2.0) {}

  /// @param reach_m  Longest sighting of the lines in the box.
  bool MayShow(const Box& box, double reach_m) const {
    return box.DistanceTo(center_) <= options_.max_distance_ratio * reach_m &&
           frustum_.MayContain(box);
  }

  /// Length of the visible part [px], or a negative number.
  double Shows(const Entry& entry) const {
    const Segment3& segment = entry.segment;
    if (entry.num_observing < options_.min_observing || !frustum_.MayContain(segment) ||
        !IsSeenAlike(entry)) {
      return -1.0;
    }
    const auto visible = ProjectSegmentInCam(
        camera_, {rotation_ * segment.start + translation_, rotation_ * segment.end + translation_},
        options_.margin_px);
    const double length = visible ? visible->Length() : -1.0;
    return length >= options_.min_length_px ? length : -1.0;
  }

 private:
  bool Counts(uint32_t key_frame) const {
    return key_frames_.empty() ||
           std::find(key_frames_.begin(), key_frames_.end(), key_frame) != key_frames_.end();
  }

  /// Some key frame saw the line from a like direction and distance.
  bool IsSeenAlike(const Entry& entry) const {
    const Eigen::Vector3d ray = center_ - entry.segment.Midpoint();
    const double distance = ray.norm(), ratio = options_.max_distance_ratio;
    for (uint32_t i = entry.sightings_begin; i < entry.sightings_end; ++i) {
      const LineSighting& sighting = sightings_[i];
      const double seen_from = static_cast<double>(sighting.distance_m);
      if (distance < ratio * seen_from && seen_from < ratio * distance &&
          sighting.direction_to_camera.cast<double>().dot(ray) > min_cosine_ * distance &&
          Counts(sighting.key_frame)) {
        return true;
      }
    }
    return false;
  }

  const Camera& camera_;
  const VisibilityOptions& options_;
  std::span<const LineSighting> sightings_;
  std::span<const uint32_t> key_frames_;
  Frustum frustum_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_, center_;
  double min_cosine_;
};

std::vector<Box> BoxesOf(const std::vector<MapLine>& lines) {
  std::vector<Box> boxes;
  boxes.reserve(lines.size());
  for (const MapLine& line : lines) {
    const Segment3& segment = line.segment_in_world;
    boxes.push_back({segment.start.cwiseMin(segment.end), segment.start.cwiseMax(segment.end)});
  }
  return boxes;
}

std::vector<Box> CentersOf(const std::vector<KeyFrame>& key_frames) {
  std::vector<Box> boxes;
  boxes.reserve(key_frames.size());
  for (const KeyFrame& key_frame : key_frames) {
    const Eigen::Vector3d center = key_frame.cam_from_world.Center();
    boxes.push_back({center, center});
  }
  return boxes;
}

Eigen::Vector3d OpticalAxis(const Rigid3& cam_from_world) {
  return cam_from_world.RotationMatrix().row(2);
}

/// Ties break by index, as pairs compare.
using RankedKeyFrame = std::pair<double, uint32_t>;

}  // namespace

struct MapIndex::Impl {
  explicit Impl(const LineMap& borrowed)
      : map(borrowed), lines(BoxesOf(borrowed.lines)), key_frames(CentersOf(borrowed.key_frames)) {
    // The longest view of each node's lines bounds how far away they can count as visible.
    reach_m.resize(lines.nodes().size());
    for (size_t i = 0; i < reach_m.size(); ++i) {
      const BoxTree::Node& node = lines.nodes()[i];
      for (uint32_t k = node.begin; k < node.end; ++k) {
        for (const LineSighting& sighting : map.SightingsOf(lines.order()[k])) {
          reach_m[i] = std::max(reach_m[i], static_cast<double>(sighting.distance_m));
        }
      }
    }
    entries.reserve(map.lines.size());
    sightings.reserve(map.sightings.size());
    for (const uint32_t line : lines.order()) {
      Entry& entry = entries.emplace_back();
      entry.segment = map.lines[line].segment_in_world;
      entry.line = line;
      entry.num_observing = map.lines[line].num_observing;
      entry.sightings_begin = static_cast<uint32_t>(sightings.size());
      const auto seen = map.SightingsOf(line);
      sightings.insert(sightings.end(), seen.begin(), seen.end());
      entry.sightings_end = static_cast<uint32_t>(sightings.size());
    }
    for (const KeyFrame& key_frame : map.key_frames) {
      axes.push_back(OpticalAxis(key_frame.cam_from_world));
      centers.push_back(key_frame.cam_from_world.Center());
    }
  }

  /// The `count` nearest, nearest first. The work space lives as long as the thread.
  const std::vector<RankedKeyFrame>& Nearest(const Rigid3& cam_from_world, size_t count) const {
    thread_local std::vector<RankedKeyFrame> best;  // a heap, the worst of the best in front
    best.clear();
    if (count == 0) return best;
    const Eigen::Vector3d center = cam_from_world.Center(), axis = OpticalAxis(cam_from_world);
    key_frames.ForEachNearestFirst(
        center,
        [&](double distance) { return best.size() < count || distance <= best.front().first; },
        [&](uint32_t k) {
          const double cosine = std::clamp(axes[k].dot(axis), -1.0, 1.0);
          const RankedKeyFrame ranked((centers[k] - center).norm() + std::acos(cosine), k);
          if (best.size() == count) {
            if (!(ranked < best.front())) return;
            std::pop_heap(best.begin(), best.end());
            best.pop_back();
          }
          best.push_back(ranked);
          std::push_heap(best.begin(), best.end());
        });
    std::sort_heap(best.begin(), best.end());
    return best;
  }

  /// Calls visit(line, length) for every visible line.
  template <typename Visit>
  void ForEachVisible(const Camera& camera, const Rigid3& cam_from_world,
                      const VisibilityOptions& options, Visit visit) const {
    if (!camera.IsValid() || !cam_from_world.IsFinite()) return;
    // The work space lives as long as the thread.
    thread_local std::vector<uint32_t> nearest;
    nearest.clear();
    for (const auto& [cost, k] : Nearest(cam_from_world, options.nearest_key_frames)) {
      nearest.push_back(k);
    }
    if (options.nearest_key_frames > 0 && nearest.empty()) return;
    const ViewTest view(camera, cam_from_world, options, sightings, nearest);
    lines.ForEachRange(
        [&](uint32_t node) { return view.MayShow(lines.nodes()[node].box, reach_m[node]); },
        [&](uint32_t begin, uint32_t end) {
          for (uint32_t i = begin; i < end; ++i) {
            const double length = view.Shows(entries[i]);
            if (length >= 0.0) visit(entries[i].line, length);
          }
        });
  }

  const LineMap& map;
  BoxTree lines, key_frames;
  std::vector<Entry> entries;           // in the order of `lines`
  std::vector<LineSighting> sightings;  // of the entries
  std::vector<double> reach_m;          // a node of `lines`
  std::vector<Eigen::Vector3d> axes, centers;
};

MapIndex::MapIndex(const LineMap& map) : impl_(std::make_unique<Impl>(map)) {}
MapIndex::~MapIndex() = default;
MapIndex::MapIndex(MapIndex&&) noexcept = default;
MapIndex& MapIndex::operator=(MapIndex&&) noexcept = default;

const LineMap& MapIndex::map() const { return impl_->map; }

void MapIndex::VisibleLines(const Camera& camera, const Rigid3& cam_from_world,
                            const VisibilityOptions& options,
                            std::vector<uint32_t>* out_lines) const {
  out_lines->clear();
  impl_->ForEachVisible(camera, cam_from_world, options,
                        [&](uint32_t line, double) { out_lines->push_back(line); });
  std::sort(out_lines->begin(), out_lines->end());
}

void MapIndex::VisibleLines(const Camera& camera, const Rigid3& cam_from_world,
                            const VisibilityOptions& options,
                            std::vector<VisibleLine>* out_lines) const {
  out_lines->clear();
  impl_->ForEachVisible(camera, cam_from_world, options, [&](uint32_t line, double length) {
    out_lines->push_back({line, static_cast<float>(length)});
  });
}

void MapIndex::NearestKeyFrames(const Rigid3& cam_from_world, uint32_t count,
                                std::vector<uint32_t>* out_key_frames) const {
  out_key_frames->clear();
  if (!cam_from_world.IsFinite()) return;
  for (const auto& [cost, k] : impl_->Nearest(cam_from_world, count)) {
    out_key_frames->push_back(k);
  }
}

}  // namespace plumb
