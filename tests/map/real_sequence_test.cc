// A map of a real RGB-D sequence must agree with frames that it was not built from. Skipped when
// the data is not there.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "plumb/features/lsd_detector.h"
#include "plumb/features/segment_refiner.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/map/line_association.h"
#include "plumb/map/map_builder.h"

namespace plumb {
namespace {

const std::filesystem::path kRoot = "../shared/data/sequences/icl_office_kt3";
constexpr Camera kCamera{481.2, 480.0, 319.5, 239.5, 640, 480};

// Timestamp (as written) to the rest of the line.
std::map<std::string, std::string> ReadTable(const std::string& name) {
  std::map<std::string, std::string> table;
  std::ifstream file(kRoot / name);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const size_t space = std::min(line.find(' '), line.size());
    table[line.substr(0, space)] = space < line.size() ? line.substr(space + 1) : "";
  }
  return table;
}

Rigid3 ParsePose(const std::string& tum) {
  std::istringstream stream(tum);
  double v[7];
  for (double& x : v) stream >> x;
  const Rigid3 world_from_cam{Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(),
                              {v[0], v[1], v[2]}};
  return world_from_cam.Inverse();
}

TEST(RealSequence, MapAgreesWithFramesThatItHasNotSeen) {
  if (!std::filesystem::exists(kRoot)) GTEST_SKIP() << kRoot << " is not there";
  const auto rgb = ReadTable("rgb.txt"), depth = ReadTable("depth.txt");
  const auto poses = ReadTable("groundtruth.txt");
  const auto detector = CreateLsdDetector();
  SegmentRefiner refiner{SegmentRefinerOptions()};
  const auto detect = [&](const std::string& stamp) {
    const cv::Mat gray = cv::imread(kRoot / rgb.at(stamp), cv::IMREAD_GRAYSCALE);
    ImageView view;
    view.width_px = gray.cols;
    view.height_px = gray.rows;
    view.planes[0] = {gray.data, static_cast<int64_t>(gray.step)};
    const auto segments = detector->Detect(view);
    EXPECT_TRUE(segments.has_value());
    return refiner.Refine(view, *segments);
  };

  MapBuilder builder;
  int64_t index = 0;
  for (const auto& [stamp, rest] : ReadTable("splits/easy_map.txt")) {
    const std::vector<Segment2> segments = detect(stamp);
    const cv::Mat raw = cv::imread(kRoot / depth.at(stamp), cv::IMREAD_UNCHANGED);
    KeyFrameInput frame;
    frame.timestamp_ns = index++;
    frame.cam_from_world = ParsePose(poses.at(stamp));
    frame.camera = kCamera;
    frame.segments = segments;
    frame.depth = {
        DepthFormat::kUint16, raw.data, static_cast<int64_t>(raw.step), raw.cols, raw.rows,
        1.0 / 5000.0};
    const Status added = builder.AddKeyFrame(frame);
    ASSERT_TRUE(added.has_value()) << added.error().message;
  }
  const Result<LineMap> map = builder.Build();
  ASSERT_TRUE(map.has_value());
  EXPECT_GT(builder.stats().num_multi_view_lines, 200u);
  EXPECT_GT(builder.stats().num_lifted, builder.stats().num_segments * 3 / 4);

  const AssociationGate gate{0.06, 4.0, 0.3, 0.0};
  size_t num_projected = 0;
  std::vector<double> distances_px;
  const auto queries = ReadTable("splits/easy_query.txt");
  ASSERT_GE(queries.size(), 41u);
  for (const size_t k : {5u, 20u, 40u}) {
    const std::string& stamp = std::next(queries.begin(), static_cast<long>(k))->first;
    const SegmentsByAngle segments(detect(stamp));
    for (uint32_t i = 0; i < map->lines.size(); ++i) {
      if (map->lines[i].num_observing < 2) continue;
      const auto projected =
          ProjectSegment(kCamera, ParsePose(poses.at(stamp)), map->lines[i].segment_in_world);
      if (!projected || projected->Length() < 15.0) continue;
      ++num_projected;
      std::vector<AssociationCandidate> candidates;
      segments.AppendCandidates({i, *projected}, gate, &candidates);
      double nearest_px = std::numeric_limits<double>::infinity();
      for (const auto& candidate : candidates) {
        nearest_px = std::min(nearest_px, candidate.distance_px);
      }
      if (std::isfinite(nearest_px)) distances_px.push_back(nearest_px);
    }
  }
  ASSERT_GT(distances_px.size(), 2 * num_projected / 3);  // the rest is occluded or not detected
  std::nth_element(distances_px.begin(), distances_px.begin() + distances_px.size() / 2,
                   distances_px.end());
  EXPECT_LT(distances_px[distances_px.size() / 2], 0.25);
}

}  // namespace
}  // namespace plumb
