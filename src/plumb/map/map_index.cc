#include "plumb/map/map_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/box_pyramid.h"
#include "plumb/map/box_tree.h"
#include "plumb/map/line_blocks.h"

namespace plumb {
namespace {

/// Where a camera with an enlarged image can see, and how far: planes with normal . x + offset >= 0
/// inside.
BoxQuery FrustumOf(const Camera& camera, const Rigid3& cam_from_world,
                   const VisibilityOptions& options) {
  const double margin = options.margin_px;
  const double right = camera.width_px - 1 + margin, bottom = camera.height_px - 1 + margin;
  // fx x / z + cx >= -margin for z > 0, and so on.
  const std::array<Eigen::Vector3d, BoxQuery::kPlanes> normals_in_cam = {
      Eigen::Vector3d(camera.fx, 0.0, camera.cx + margin),
      Eigen::Vector3d(-camera.fx, 0.0, right - camera.cx),
      Eigen::Vector3d(0.0, camera.fy, camera.cy + margin),
      Eigen::Vector3d(0.0, -camera.fy, bottom - camera.cy),
      Eigen::Vector3d(0.0, 0.0, 1.0),
  };
  const Eigen::Matrix3d world_from_cam = cam_from_world.RotationMatrix().transpose();
  BoxQuery query;
  for (size_t i = 0; i < BoxQuery::kPlanes; ++i) {
    const Eigen::Vector3d normal = normals_in_cam[i].normalized();
    query.normals[i] = world_from_cam * normal;
    query.offsets[i] = normal.dot(cam_from_world.translation);
  }
  query.offsets.back() -= kNearPlane;
  query.center = cam_from_world.Center();
  query.reach_factor = options.max_distance_ratio;
  return query;
}

/// Whether some key frame saw a line from a like direction and distance.
class SightingTest {
 public:
  /// @param key_frames  Whose sightings count, borrowed; none: all.
  SightingTest(const VisibilityOptions& options, std::span<const uint32_t> key_frames)
      : ratio_(options.max_distance_ratio),
        min_cosine_(options.max_view_angle_rad < std::numbers::pi
                        ? std::cos(options.max_view_angle_rad)
                        : -2.0),
        key_frames_(key_frames) {}

  enum class Answer { kNo, kYes, kUnsure };

  /// @param ray  From the line's middle to the camera.
  Answer Ask(const Eigen::Vector3f& ray, std::span<const LineSighting> sightings) const {
    constexpr float kSlack = 1e-5f;
    const float distance = ray.norm();
    const auto ratio = static_cast<float>(ratio_), min_cosine = static_cast<float>(min_cosine_);
    const float sure = 1.0f + kSlack, perhaps = 1.0f - kSlack;
    Answer answer = Answer::kNo;
    for (const LineSighting& sighting : sightings) {
      const float seen_from = sighting.distance_m;
      const float along = sighting.direction_to_camera.dot(ray);
      const float farthest = ratio * seen_from, nearest = ratio * distance;
      if (!(distance * perhaps < farthest && seen_from * perhaps < nearest &&
            along > (min_cosine - kSlack) * distance) ||
          !Counts(sighting.key_frame)) {
        continue;
      }
      if (distance * sure < farthest && seen_from * sure < nearest &&
          along > (min_cosine + kSlack) * distance) {
        return Answer::kYes;
      }
      answer = Answer::kUnsure;
    }
    return answer;
  }

  bool AskExactly(const Eigen::Vector3d& ray, std::span<const LineSighting> sightings) const {
    const double distance = ray.norm();
    for (const LineSighting& sighting : sightings) {
      const double seen_from = static_cast<double>(sighting.distance_m);
      if (distance < ratio_ * seen_from && seen_from < ratio_ * distance &&
          sighting.direction_to_camera.cast<double>().dot(ray) > min_cosine_ * distance &&
          Counts(sighting.key_frame)) {
        return true;
      }
    }
    return false;
  }

 private:
  bool Counts(uint32_t key_frame) const {
    return key_frames_.empty() ||
           std::find(key_frames_.begin(), key_frames_.end(), key_frame) != key_frames_.end();
  }

  double ratio_, min_cosine_;
  std::span<const uint32_t> key_frames_;
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

/// The longest view of each line bounds how far away it can count as visible.
std::vector<float> ReachOf(const LineMap& map) {
  std::vector<float> reach_m(map.lines.size(), 0.0f);
  for (uint32_t i = 0; i < reach_m.size(); ++i) {
    for (const LineSighting& sighting : map.SightingsOf(i)) {
      reach_m[i] = std::max(reach_m[i], sighting.distance_m);
    }
  }
  return reach_m;
}

struct MapIndex::Impl {
  explicit Impl(const LineMap& borrowed)
      : map(borrowed),
        pyramid(BoxesOf(borrowed.lines), ReachOf(borrowed)),
        blocks(borrowed, pyramid.order()),
        key_frames(CentersOf(borrowed.key_frames)) {
    sighting_begin.reserve(map.lines.size() + 1);
    sightings.reserve(map.sightings.size());
    for (const uint32_t line : pyramid.order()) {
      sighting_begin.push_back(static_cast<uint32_t>(sightings.size()));
      const auto seen = map.SightingsOf(line);
      sightings.insert(sightings.end(), seen.begin(), seen.end());
    }
    sighting_begin.push_back(static_cast<uint32_t>(sightings.size()));
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
    thread_local std::vector<uint32_t> leaves;
    thread_local std::vector<BlockLine> found;
    pyramid.Find(FrustumOf(camera, cam_from_world, options), &leaves);
    blocks.Project(camera, cam_from_world, options.margin_px, options.min_length_px,
                   options.min_observing, leaves, &found);
    const SightingTest test(options, nearest);
    const Eigen::Vector3d center = cam_from_world.Center();
    for (const BlockLine& candidate : found) {
      const uint32_t row = candidate.row;
      const auto seen = std::span(sightings).subspan(sighting_begin[row],
                                                     sighting_begin[row + 1] - sighting_begin[row]);
      const uint32_t line = pyramid.order()[row];
      const Segment3& segment = map.lines[line].segment_in_world;
      SightingTest::Answer answer = test.Ask(-blocks.MidpointFrom(center, row), seen);
      if (answer == SightingTest::Answer::kUnsure) {
        answer = test.AskExactly(center - segment.Midpoint(), seen) ? SightingTest::Answer::kYes
                                                                    : SightingTest::Answer::kNo;
      }
      if (answer == SightingTest::Answer::kNo) continue;
      double length = static_cast<double>(candidate.length_px);
      if (length < 0.0) {
        const auto visible = ProjectSegment(camera, cam_from_world, segment, options.margin_px);
        length = visible ? visible->Length() : -1.0;
        if (!(length >= options.min_length_px)) continue;
      }
      visit(line, length);
    }
  }

  const LineMap& map;
  BoxPyramid pyramid;
  LineBlocks blocks;  // their rows are pyramid.order()
  BoxTree key_frames;
  std::vector<uint32_t> sighting_begin;  // of every row, and the end
  std::vector<LineSighting> sightings;   // of the rows
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
