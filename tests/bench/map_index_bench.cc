// What a camera sees of a map of many rooms: MapIndex, a Boost R-tree and a scan over all lines.
//   build/release/bin/bench_map_index
#include <benchmark/benchmark.h>

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/map_index.h"

namespace plumb {
namespace {

namespace bg = boost::geometry;
using RtreePoint = bg::model::point<double, 3, bg::cs::cartesian>;
using RtreeBox = bg::model::box<RtreePoint>;
using Rtree = bg::index::rtree<std::pair<RtreeBox, uint32_t>, bg::index::quadratic<16>>;

constexpr Camera kCamera{525.0, 525.0, 319.5, 239.5, 640, 480};
constexpr uint32_t kLinesInARoom = 2000, kViewsInARoom = 25;

/// Rooms of 6 x 6 x 3 m on a square grid, each with its own key frames.
struct City {
  explicit City(uint32_t num_lines) {
    std::mt19937 rng(1);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(rng);
    };
    const uint32_t num_rooms = std::max(1u, num_lines / kLinesInARoom);
    const uint32_t lines_in_a_room = std::min(num_lines, kLinesInARoom);
    const auto side = static_cast<uint32_t>(std::ceil(std::sqrt(num_rooms)));
    for (uint32_t room = 0; room < num_rooms; ++room) {
      const Eigen::Vector3d corner(6.0 * (room % side), 0.0, 6.0 * (room / side));
      const auto inside = [&](double border) -> Eigen::Vector3d {
        return corner + Eigen::Vector3d(uniform(border, 6 - border), uniform(border, 3 - border),
                                        uniform(border, 6 - border));
      };
      const auto first_view = static_cast<uint32_t>(map.key_frames.size());
      for (uint32_t k = 0; k < kViewsInARoom; ++k) {
        KeyFrame key_frame;
        const Eigen::Quaterniond rotation = ExpSo3({0.0, uniform(-3.1, 3.1), 0.0});
        key_frame.cam_from_world = {rotation, -(rotation * inside(1.0))};
        map.key_frames.push_back(key_frame);
      }
      for (uint32_t i = 0; i < lines_in_a_room; ++i) {
        MapLine line;
        const Eigen::Vector3d midpoint = inside(0.3);
        const Eigen::Vector3d half(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.3, 0.3));
        line.segment_in_world = {midpoint - half, midpoint + half};
        for (uint32_t k = first_view + i % 5; k < map.key_frames.size(); k += 5) {
          const Eigen::Vector3d ray = map.key_frames[k].cam_from_world.Center() - midpoint;
          map.sightings.push_back(
              {k, ray.normalized().cast<float>(), static_cast<float>(ray.norm())});
          ++line.num_observing;
        }
        line.num_expected = line.num_observing;
        map.sighting_begin.push_back(static_cast<uint32_t>(map.sightings.size()));
        map.lines.push_back(line);
      }
    }
    for (int i = 0; i < 64; ++i) {  // priors near key frames
      Rigid3 pose = map.key_frames[rng() % map.key_frames.size()].cam_from_world;
      pose.translation += Eigen::Vector3d(uniform(-0.1, 0.1), 0.0, uniform(-0.1, 0.1));
      poses.push_back(pose);
    }
  }
  LineMap map;
  std::vector<Rigid3> poses;
};

const City& CityOf(int64_t num_lines) {
  static std::unique_ptr<City> city;
  static int64_t size = 0;
  if (size != num_lines) {
    city.reset();
    city = std::make_unique<City>(static_cast<uint32_t>(num_lines));
    size = num_lines;
  }
  return *city;
}

/// The test of one line, as MapIndex does it.
bool IsVisible(const LineMap& map, uint32_t i, const Rigid3& pose, const Eigen::Vector3d& center,
               const VisibilityOptions& options) {
  const MapLine& line = map.lines[i];
  if (line.num_observing < options.min_observing) return false;
  const Eigen::Vector3d ray = center - line.segment_in_world.Midpoint();
  const double distance = ray.norm(), min_cosine = std::cos(options.max_view_angle_rad);
  for (const LineSighting& sighting : map.SightingsOf(i)) {
    const double seen_from = static_cast<double>(sighting.distance_m);
    if (distance < options.max_distance_ratio * seen_from &&
        seen_from < options.max_distance_ratio * distance &&
        sighting.direction_to_camera.cast<double>().dot(ray) > min_cosine * distance) {
      const auto image = ProjectSegment(kCamera, pose, line.segment_in_world, options.margin_px);
      return image && image->Length() >= options.min_length_px;
    }
  }
  return false;
}

void ReportLines(benchmark::State& state, size_t num_lines) {
  state.counters["visible"] = static_cast<double>(num_lines);
}

void BM_MapIndex(benchmark::State& state) {
  const City& city = CityOf(state.range(0));
  const MapIndex index(city.map);
  std::vector<uint32_t> lines;
  size_t i = 0;
  for (auto _ : state) {
    index.VisibleLines(kCamera, city.poses[i++ % city.poses.size()], {}, &lines);
    benchmark::DoNotOptimize(lines.data());
  }
  ReportLines(state, lines.size());
}

/// The box around the frustum, cut at twice the longest view, asks the tree.
void BM_BoostRtree(benchmark::State& state) {
  const City& city = CityOf(state.range(0));
  const LineMap& map = city.map;
  const VisibilityOptions options;
  double reach = 0.0;
  std::vector<std::pair<RtreeBox, uint32_t>> boxes;
  for (uint32_t k = 0; k < map.lines.size(); ++k) {
    const Segment3& segment = map.lines[k].segment_in_world;
    const Eigen::Vector3d lower = segment.start.cwiseMin(segment.end);
    const Eigen::Vector3d upper = segment.start.cwiseMax(segment.end);
    boxes.emplace_back(
        RtreeBox{{lower.x(), lower.y(), lower.z()}, {upper.x(), upper.y(), upper.z()}}, k);
    for (const LineSighting& sighting : map.SightingsOf(k)) {
      reach =
          std::max(reach, options.max_distance_ratio * static_cast<double>(sighting.distance_m));
    }
  }
  const Rtree tree(boxes);  // packed
  std::vector<std::pair<RtreeBox, uint32_t>> found;
  std::vector<uint32_t> lines;
  size_t i = 0;
  for (auto _ : state) {
    const Rigid3& pose = city.poses[i++ % city.poses.size()];
    const Rigid3 world_from_cam = pose.Inverse();
    const Eigen::Vector3d center = pose.Center();
    Eigen::Vector3d lower = center, upper = center;
    for (const double u : {-options.margin_px, kCamera.width_px + options.margin_px}) {
      for (const double v : {-options.margin_px, kCamera.height_px + options.margin_px}) {
        const Eigen::Vector2d x = kCamera.Normalize({u, v});
        const Eigen::Vector3d corner =
            world_from_cam * Eigen::Vector3d(reach * x.x(), reach * x.y(), reach);
        lower = lower.cwiseMin(corner);
        upper = upper.cwiseMax(corner);
      }
    }
    found.clear();
    lines.clear();
    tree.query(bg::index::intersects(
                   RtreeBox{{lower.x(), lower.y(), lower.z()}, {upper.x(), upper.y(), upper.z()}}),
               std::back_inserter(found));
    for (const auto& [box, line] : found) {
      if (IsVisible(map, line, pose, center, options)) lines.push_back(line);
    }
    std::sort(lines.begin(), lines.end());
    benchmark::DoNotOptimize(lines.data());
  }
  ReportLines(state, lines.size());
}

void BM_AllLines(benchmark::State& state) {
  const City& city = CityOf(state.range(0));
  std::vector<uint32_t> lines;
  size_t i = 0;
  for (auto _ : state) {
    const Rigid3& pose = city.poses[i++ % city.poses.size()];
    const Eigen::Vector3d center = pose.Center();
    lines.clear();
    for (uint32_t k = 0; k < city.map.lines.size(); ++k) {
      if (IsVisible(city.map, k, pose, center, {})) lines.push_back(k);
    }
    benchmark::DoNotOptimize(lines.data());
  }
  ReportLines(state, lines.size());
}

void BM_NearestKeyFrames(benchmark::State& state) {
  const City& city = CityOf(state.range(0));
  const MapIndex index(city.map);
  std::vector<uint32_t> key_frames;
  size_t i = 0;
  for (auto _ : state) {
    index.NearestKeyFrames(city.poses[i++ % city.poses.size()], 10, &key_frames);
    benchmark::DoNotOptimize(key_frames.data());
  }
}

#define PLUMB_SIZES \
  ->Arg(1000)->Arg(10000)->Arg(100000)->Arg(1000000)->Arg(10000000)->Unit(benchmark::kMicrosecond)
BENCHMARK(BM_MapIndex) PLUMB_SIZES;
BENCHMARK(BM_BoostRtree) PLUMB_SIZES;
BENCHMARK(BM_AllLines) PLUMB_SIZES;
BENCHMARK(BM_NearestKeyFrames) PLUMB_SIZES;

}  // namespace
}  // namespace plumb
