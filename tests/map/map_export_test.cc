#include "plumb/map/map_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <sstream>

#include "support/random_map.h"
#include "support/temporary_directory.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MakeRandomMap;
using testing::Slurp;
using testing::Spill;
using testing::TemporaryDirectory;

struct Edge {
  int32_t first, second;
  uint32_t observing;
  float sigma_m;
};

/// The lines of a PLY file; the machine that runs the tests is little endian.
struct Ply {
  explicit Ply(const std::string& content) {
    const size_t end = content.find("end_header\n") + 11;
    header = content.substr(0, end);
    size_t num_vertices = 0, num_edges = 0;
    std::sscanf(header.c_str() + header.find("element vertex"), "element vertex %zu",
                &num_vertices);
    std::sscanf(header.c_str() + header.find("element edge"), "element edge %zu", &num_edges);
    vertices.resize(num_vertices);
    edges.resize(num_edges);
    EXPECT_EQ(content.size(), end + 24 * num_vertices + 16 * num_edges);
    const char* data = content.data() + end;
    for (auto& vertex : vertices) {
      std::memcpy(vertex.data(), data, 24);
      data += 24;
    }
    for (Edge& edge : edges) {
      std::memcpy(&edge, data, 16);
      data += 16;
    }
  }
  std::string header;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Edge> edges;
};

TEST(ExportLines, PlyHoldsEveryLineExactly) {
  const TemporaryDirectory root;
  const LineMap map = MakeRandomMap({25, 5, 0, 0}, /*seed=*/1);
  ASSERT_TRUE(ExportLines(map, root / "map.ply"));
  const Ply ply(Slurp(root / "map.ply"));
  EXPECT_EQ(ply.header.rfind("ply\nformat binary_little_endian 1.0\n", 0), 0u);
  ASSERT_EQ(ply.edges.size(), map.lines.size());
  for (size_t i = 0; i < map.lines.size(); ++i) {
    const MapLine& line = map.lines[i];
    EXPECT_EQ(ply.vertices[ply.edges[i].first], line.segment_in_world.start);
    EXPECT_EQ(ply.vertices[ply.edges[i].second], line.segment_in_world.end);
    EXPECT_EQ(ply.edges[i].observing, line.num_observing);
    // MakeRandomMap's end point covariance: 4e-6 in two directions.
    EXPECT_NEAR(ply.edges[i].sigma_m, std::sqrt(8e-6), 1e-8);
  }
}

TEST(ExportLines, ObjReadsBackToTheSameNumbers) {
  const TemporaryDirectory root;
  const LineMap map = MakeRandomMap({25, 5, 0, 0}, /*seed=*/2, {1.0e5, 1.0e-5, -3.0});
  ASSERT_TRUE(ExportLines(map, root / "map.obj", {.format = MapExportFormat::kObj}));
  std::istringstream in(Slurp(root / "map.obj"));
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<size_t, 2>> lines;
  std::string row;
  while (std::getline(in, row)) {
    std::istringstream fields(row);
    std::string key;
    fields >> key;
    if (key == "v") {
      Eigen::Vector3d x;
      fields >> x.x() >> x.y() >> x.z();
      vertices.push_back(x);
    } else if (key == "l") {
      std::array<size_t, 2> line = {};
      fields >> line[0] >> line[1];
      lines.push_back(line);
    } else {
      EXPECT_EQ(key, "#");
    }
    EXPECT_FALSE(fields.bad());
  }
  ASSERT_EQ(lines.size(), map.lines.size());
  for (size_t i = 0; i < lines.size(); ++i) {
    EXPECT_EQ(vertices.at(lines[i][0] - 1), map.lines[i].segment_in_world.start);
    EXPECT_EQ(vertices.at(lines[i][1] - 1), map.lines[i].segment_in_world.end);
  }
}

TEST(ExportLines, LeavesOutLinesThatTooFewKeyFramesObserved) {
  const TemporaryDirectory root;
  const LineMap map = MakeRandomMap({10, 4, 0, 0}, /*seed=*/3);  // 4 and 2 observations in turn
  ASSERT_TRUE(ExportLines(map, root / "map.ply", {.min_observing = 3}));
  const Ply ply(Slurp(root / "map.ply"));
  ASSERT_EQ(ply.edges.size(), 5u);
  EXPECT_EQ(ply.vertices[2], map.lines[2].segment_in_world.start);
}

TEST(ExportLines, WritesAnEmptyMapAsAValidFile) {
  const TemporaryDirectory root;
  ASSERT_TRUE(ExportLines(LineMap{}, root / "map.ply"));
  EXPECT_THAT(Slurp(root / "map.ply"), HasSubstr("element edge 0\n"));
}

TEST(ExportLines, ReplacesAnExistingFileAndLeavesNoOther) {
  const TemporaryDirectory root;
  Spill(root / "map.obj", "old");
  ASSERT_TRUE(ExportLines(LineMap{}, root / "map.obj", {.format = MapExportFormat::kObj}));
  EXPECT_THAT(Slurp(root / "map.obj"), HasSubstr("plumbline"));
  EXPECT_THAT(root.Names(), ElementsAre("map.obj"));
}

TEST(ExportLines, SaysThatTheDirectoryDoesNotExist) {
  const TemporaryDirectory root;
  const Status status = ExportLines(LineMap{}, root / "nowhere/map.ply");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(status.error().message, HasSubstr("nowhere"));
}

TEST(ExportLines, LeavesNothingBehindWhenTheTargetIsADirectory) {
  const TemporaryDirectory root;
  std::filesystem::create_directory(root / "map.ply");
  const Status status = ExportLines(LineMap{}, root / "map.ply");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIoError);
  EXPECT_THAT(root.Names(), ElementsAre("map.ply"));
}

}  // namespace
}  // namespace plumb
