#include "plumb/map/map_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <limits>
#include <utility>

#include "plumb/map/map_check.h"
#include "plumb/map/map_manifest.h"
#include "plumb/map/map_tiles.h"
#include "support/random_map.h"
#include "support/temporary_directory.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MakeRandomMap;
using testing::Slurp;
using testing::Spill;
using testing::TemporaryDirectory;

const std::vector<std::string> kFiles = {"manifest.json",       "tiles/lines.plt",
                                         "tiles/sightings.plt", "tiles/key_frames.plt",
                                         "tiles/segments.plt",  "tiles/points.plt"};

/// Writes a map without the checks of WriteMap(), with checksums that are right.
void WriteUnchecked(const LineMap& map, const std::string& directory) {
  const Eigen::Vector3d origin = ChooseOrigin(map);
  const MapTiles tiles = EncodeTiles(map, origin);
  MapManifest manifest = DescribeTiles(tiles);
  manifest.detector = map.detector;
  manifest.depth_source = map.depth_source;
  manifest.covariance_factor = map.covariance_factor;
  manifest.covariance_growth = map.covariance_growth;
  manifest.pose_change = map.pose_change;
  manifest.camera_correction = map.camera_correction;
  manifest.origin = origin;
  std::filesystem::create_directories(directory + "/tiles");
  Spill(directory + "/manifest.json", WriteManifest(manifest));
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    Spill(directory + "/tiles/" + manifest.tiles[i].file, tiles[i]);
  }
}

/// A manifest whose text a stranger changed, with a checksum that is right.
std::string Reseal(const std::string& manifest, const std::string& from, const std::string& to) {
  std::string text = manifest;
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  std::string body = text.substr(0, text.size() - 20);
  char hex[17];
  std::snprintf(hex, sizeof(hex), "%016llx", static_cast<unsigned long long>(Checksum(body)));
  return body + hex + "\"\n}\n";
}

class MapFileTest : public ::testing::Test {
 protected:
  TemporaryDirectory root_;
  const std::string path_ = root_ / "map";
};

TEST_F(MapFileTest, KeepsEverythingWithinFloatOfTheOrigin) {
  const LineMap map = MakeRandomMap({30, 6, 9, 4}, /*seed=*/1);
  ASSERT_TRUE(WriteMap(map, path_));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_TRUE(read) << read.error().message;

  EXPECT_EQ(read->detector, map.detector);
  EXPECT_EQ(read->depth_source, map.depth_source);
  EXPECT_EQ(read->covariance_factor, map.covariance_factor);
  EXPECT_EQ(read->covariance_growth, map.covariance_growth);
  ASSERT_TRUE(read->pose_change);
  EXPECT_EQ(read->pose_change->position_m, map.pose_change->position_m);
  EXPECT_EQ(read->pose_change->rotation_rad, map.pose_change->rotation_rad);
  ASSERT_TRUE(read->camera_correction);
  EXPECT_EQ(read->camera_correction->given, map.camera_correction->given);
  EXPECT_EQ(read->camera_correction->corrected, map.camera_correction->corrected);
  EXPECT_EQ(read->sighting_begin, map.sighting_begin);
  ASSERT_EQ(read->lines.size(), map.lines.size());
  for (size_t i = 0; i < map.lines.size(); ++i) {
    const MapLine &a = map.lines[i], &b = read->lines[i];
    EXPECT_LT((a.segment_in_world.start - b.segment_in_world.start).norm(), 1e-6);
    EXPECT_LT((a.segment_in_world.end - b.segment_in_world.end).norm(), 1e-6);
    EXPECT_TRUE(a.covariance_start.isApprox(b.covariance_start, 1e-6));
    EXPECT_TRUE(a.covariance_end.isApprox(b.covariance_end, 1e-6));
    EXPECT_EQ(a.num_observing, b.num_observing);
    EXPECT_EQ(a.num_expected, b.num_expected);
  }
  ASSERT_EQ(read->sightings.size(), map.sightings.size());
  for (size_t i = 0; i < map.sightings.size(); ++i) {
    EXPECT_EQ(read->sightings[i].key_frame, map.sightings[i].key_frame);
    EXPECT_EQ(read->sightings[i].direction_to_camera, map.sightings[i].direction_to_camera);
    EXPECT_EQ(read->sightings[i].distance_m, map.sightings[i].distance_m);
  }
}

TEST_F(MapFileTest, KeepsKeyFramesExactlyAndTheirContentWithinFloat) {
  const LineMap map = MakeRandomMap({4, 5, 7, 6}, /*seed=*/2);
  ASSERT_TRUE(WriteMap(map, path_));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->key_frames.size(), map.key_frames.size());
  for (size_t k = 0; k < map.key_frames.size(); ++k) {
    const KeyFrame &a = map.key_frames[k], &b = read->key_frames[k];
    EXPECT_EQ(a.timestamp_ns, b.timestamp_ns);
    EXPECT_EQ(a.cam_from_world.rotation.coeffs(), b.cam_from_world.rotation.coeffs());
    EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
    EXPECT_EQ(a.camera.fx, b.camera.fx);
    EXPECT_EQ(a.camera.cy, b.camera.cy);
    EXPECT_EQ(a.camera.width_px, b.camera.width_px);
    ASSERT_EQ(a.segments.size(), b.segments.size());
    for (size_t i = 0; i < a.segments.size(); ++i) {
      EXPECT_LT((a.segments[i].segment_px.end - b.segments[i].segment_px.end).norm(), 1e-4);
      EXPECT_NEAR(a.segments[i].segment_px.score, b.segments[i].segment_px.score, 1e-7);
      EXPECT_LT(
          (a.segments[i].segment_in_world.start - b.segments[i].segment_in_world.start).norm(),
          1e-6);
      EXPECT_EQ(a.segments[i].line, b.segments[i].line);
    }
    ASSERT_EQ(a.points.size(), b.points.size());
    for (size_t i = 0; i < a.points.size(); ++i) {
      EXPECT_EQ(a.points[i].pixel, b.points[i].pixel);
      EXPECT_LT((a.points[i].point_in_world - b.points[i].point_in_world).norm(), 1e-6f);
      EXPECT_EQ(a.points[i].descriptor, b.points[i].descriptor);
    }
  }
}

TEST_F(MapFileTest, WritesTheSameBytesAgainAfterReading) {
  // Far from the world's origin and at every scale, where rounding twice would show.
  for (const double offset : {0.0, 0.1, 123.4, 54321.0, 4.0e6}) {
    const LineMap map = MakeRandomMap({20, 4, 5, 5}, /*seed=*/3, {offset, -offset, 0.5 * offset});
    const std::string first = root_ / "a" + std::to_string(offset);
    const std::string second = root_ / "b" + std::to_string(offset);
    ASSERT_TRUE(WriteMap(map, first));
    const Result<LineMap> read = ReadMap(first);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_TRUE(WriteMap(*read, second));
    for (const std::string& file : kFiles) {
      EXPECT_EQ(Slurp(first + "/" + file), Slurp(second + "/" + file)) << file << " at " << offset;
    }
  }
}

TEST_F(MapFileTest, KeepsMillimetresFarFromTheOriginOfTheWorld) {
  const LineMap map = MakeRandomMap({20, 4, 5, 0}, /*seed=*/4, {5.0e5, 4.0e6, 100.0});
  ASSERT_TRUE(WriteMap(map, path_));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_TRUE(read) << read.error().message;
  for (size_t i = 0; i < map.lines.size(); ++i) {
    EXPECT_LT((map.lines[i].segment_in_world.start - read->lines[i].segment_in_world.start).norm(),
              1e-6);
  }
}

TEST_F(MapFileTest, KeepsAnEmptyMap) {
  ASSERT_TRUE(WriteMap(LineMap{}, path_));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_THAT(read->lines, IsEmpty());
  EXPECT_THAT(read->key_frames, IsEmpty());
  EXPECT_THAT(read->sighting_begin, ElementsAre(0u));
}

TEST_F(MapFileTest, RefusesEveryTruncation) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/5), path_));
  for (const std::string& file : kFiles) {
    const std::string whole = Slurp(path_ + "/" + file);
    ASSERT_FALSE(whole.empty());
    for (size_t size = 0; size < whole.size(); ++size) {
      Spill(path_ + "/" + file, whole.substr(0, size));
      const Result<LineMap> read = ReadMap(path_);
      ASSERT_FALSE(read) << file << " cut to " << size;
      ASSERT_EQ(read.error().code, ErrorCode::kCorruptData) << file << " cut to " << size;
    }
    Spill(path_ + "/" + file, whole);
  }
  EXPECT_TRUE(ReadMap(path_));
}

TEST_F(MapFileTest, RefusesEveryFlippedBit) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/6), path_));
  for (const std::string& file : kFiles) {
    const std::string whole = Slurp(path_ + "/" + file);
    for (size_t bit = 0; bit < 8 * whole.size(); ++bit) {
      std::string flipped = whole;
      flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << bit % 8));
      Spill(path_ + "/" + file, flipped);
      const Result<LineMap> read = ReadMap(path_);
      ASSERT_FALSE(read) << file << ", bit " << bit;
      ASSERT_EQ(read.error().code, ErrorCode::kCorruptData) << file << ", bit " << bit;
    }
    Spill(path_ + "/" + file, whole);
  }
  EXPECT_TRUE(ReadMap(path_));
}

TEST_F(MapFileTest, RefusesFilesThatGrew) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/7), path_));
  for (const std::string& file : kFiles) {
    const std::string whole = Slurp(path_ + "/" + file);
    Spill(path_ + "/" + file, whole + " ");
    EXPECT_FALSE(ReadMap(path_)) << file;
    Spill(path_ + "/" + file, whole);
  }
}

TEST_F(MapFileTest, RefusesMissingFilesByName) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/8), path_));
  ASSERT_EQ(unlink((path_ + "/tiles/points.plt").c_str()), 0);
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(read.error().message, HasSubstr("points.plt"));
}

TEST_F(MapFileTest, SaysThatThereIsNoMap) {
  EXPECT_EQ(ReadMap(root_ / "nothing").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadMap(root_.path()).error().code, ErrorCode::kNotFound);
  Spill(root_ / "file", "text");
  EXPECT_EQ(ReadMap(root_ / "file").error().code, ErrorCode::kNotFound);
}

TEST_F(MapFileTest, SaysThatAnotherVersionIsUnsupported) {
  ASSERT_TRUE(WriteMap(LineMap{}, path_));
  const std::string manifest = path_ + "/manifest.json";
  Spill(manifest, Reseal(Slurp(manifest), "plumb.map/1", "plumb.map/2"));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(read.error().message, HasSubstr("plumb.map/2"));
}

TEST_F(MapFileTest, AMapThatDoesNotSayItsDepthHasASensors) {
  LineMap map;
  ASSERT_TRUE(WriteMap(map, path_));
  const std::string manifest = path_ + "/manifest.json";
  Spill(manifest, Reseal(Slurp(manifest), "  \"depth\": \"sensor\",\n", ""));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->depth_source, DepthSource::kSensor);
}

TEST_F(MapFileTest, RefusesHostileManifests) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/9, {0, 0, 0}), path_));
  const std::string path = path_ + "/manifest.json", good = Slurp(path);
  const std::string deep(100'000, '[');
  const struct {
    const char* what;
    std::string from, to;
  } cases[] = {
      {"2^63 records", "\"records\": 2", "\"records\": 9223372036854775808"},
      {"2^32 records with the bytes that belong to them", "\"records\": 2,\n      \"bytes\": 168",
       "\"records\": 4294967296,\n      \"bytes\": 360777252864"},
      {"records that wrap around 64 bits", "\"records\": 2,\n      \"bytes\": 168",
       "\"records\": 4611686018427387906,\n      \"bytes\": 168"},
      {"a negative count", "\"records\": 2", "\"records\": -2"},
      {"a fraction of a record", "\"records\": 2", "\"records\": 2.5"},
      {"a count as text", "\"records\": 2", "\"records\": \"2\""},
      {"a size that is no multiple of the record", "\"bytes\": 168", "\"bytes\": 167"},
      {"a checksum that is too short", "\"xxh3\": \"", "\"xxh3\": \"0"},
      {"a file outside the map", "lines.plt", "../lines.plt"},
      {"an absolute path", "lines.plt", "/etc/passwd"},
      {"a hidden file", "lines.plt", ".plt"},
      {"an empty name", "lines.plt", ""},
      {"a name with a NUL", "lines.plt", "lines.plt\\u0000"},
      {"kinds out of order", "\"kind\": \"lines\"", "\"kind\": \"points\""},
      {"NaN", "\"covariance_factor\": 2.25", "\"covariance_factor\": NaN"},
      {"an infinite factor", "\"covariance_factor\": 2.25", "\"covariance_factor\": 1e999"},
      {"a factor of 0", "\"covariance_factor\": 2.25", "\"covariance_factor\": 0.0"},
      {"a negative factor", "\"covariance_factor\": 2.25", "\"covariance_factor\": -1.0"},
      {"a factor that is null", "\"covariance_factor\": 2.25", "\"covariance_factor\": null"},
      {"no factor", "covariance_factor", "covariance"},
      {"a negative growth", "\"covariance_growth\": 0.75", "\"covariance_growth\": -0.75"},
      {"half a change of poses", "position_m", "position"},
      {"a change of poses that is text", "\"rotation_rad\": 0.002", "\"rotation_rad\": \"2\""},
      {"a negative change of poses", "\"position_m\": 0.004", "\"position_m\": -0.004"},
      {"a camera without the corrected one", "\"corrected\"", "\"other\""},
      {"a camera without a number", "\"fx\": 523.7", "\"fx\": null"},
      {"a camera of no focal length", "\"fx\": 523.7", "\"fx\": 0.0"},
      {"a camera of no size", "\"width\": 640", "\"width\": 0"},
      {"a camera of a huge size", "\"width\": 640", "\"width\": 4294967936"},
      {"a corrected camera of another size", "480,\n      \"fx\": 523.7",
       "481,\n      \"fx\": 523.7"},
      {"a corrected camera that mirrors", "\"fx\": 523.7", "\"fx\": -523.7"},
      {"a lens of another kind", "\"RADTAN\"", "\"MIRROR\""},
      {"a lens of too few numbers", "0.01,", ""},
      {"a lens of text", "0.01,", "\"0.01\","},
      {"a growth that is null", "\"covariance_growth\": 0.75", "\"covariance_growth\": null"},
      {"a depth of another kind", "\"views\"", "\"sonar\""},
      {"a depth that is a number", "\"views\"", "7"},
      {"a detector that is a number", "\"lsd\"", "7"},
      {"a detector that is a path", "\"lsd\"", "\"/tmp/weights.safetensors\""},
      {"a detector of two lines", "\"lsd\"", "\"a\\nb\""},
      {"a detector that is not UTF-8", "\"lsd\"", "\"\xff\xfe\""},
      {"a huge detector", "\"lsd\"", "\"" + std::string(5000, 'x') + "\""},
      {"an origin that is text", "\"origin\": [", "\"origin\": [\"0\", "},
      {"no schema", "\"schema\"", "\"scheme\""},
      {"a schema that is a list", "\"plumb.map/1\"", "[\"plumb.map/1\"]"},
      {"tiles that are an object", "\"tiles\": [", "\"tiles\": {}, \"files\": ["},
      {"nesting without end", "\"lsd\"", deep},
      {"nesting with an end", "\"lsd\"", std::string(9, '[') + std::string(9, ']')},
      {"no JSON", "{", "<"},
      {"an array", "{", "[{"},
  };
  for (const auto& c : cases) {
    Spill(path, Reseal(good, c.from, c.to));
    const Result<LineMap> read = ReadMap(path_);
    ASSERT_FALSE(read) << c.what;
    EXPECT_EQ(read.error().code, ErrorCode::kCorruptData) << c.what << ": " << read.error().message;
  }
  Spill(path, Reseal(good, "\"lsd\"", "\"other\""));
  EXPECT_TRUE(ReadMap(path_)) << "The resealed manifest must be refused for its content alone.";
}

TEST_F(MapFileTest, RefusesAManifestOfUnreasonableSize) {
  ASSERT_TRUE(WriteMap(LineMap{}, path_));
  const std::string path = path_ + "/manifest.json";
  Spill(path, Reseal(Slurp(path), "{", "{" + std::string(1 << 20, ' ')));
  const Result<LineMap> read = ReadMap(path_);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kCorruptData);
}

TEST_F(MapFileTest, RefusesRecordsWithBadContentThoughTheirChecksumsAreRight) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const struct {
    const char* what;
    std::function<void(LineMap*)> spoil;
  } cases[] = {
      {"NaN end point", [](LineMap* m) { m->lines[1].segment_in_world.start.y() = kNan; }},
      {"infinite end point", [](LineMap* m) { m->lines[1].segment_in_world.end.x() = 1e300; }},
      {"line without length",
       [](LineMap* m) { m->lines[0].segment_in_world.end = m->lines[0].segment_in_world.start; }},
      {"NaN covariance", [](LineMap* m) { m->lines[0].covariance_end(1, 2) = kNan; }},
      {"negative variance", [](LineMap* m) { m->lines[0].covariance_start(0, 0) = -1.0; }},
      {"never observed", [](LineMap* m) { m->lines[0].num_observing = 0; }},
      {"more observed than expected", [](LineMap* m) { m->lines[0].num_expected = 0; }},
      {"sighting by an unknown key frame", [](LineMap* m) { m->sightings.back().key_frame = 9; }},
      {"sightings out of order",
       [](LineMap* m) { std::swap(m->sightings[0].key_frame, m->sightings[1].key_frame); }},
      {"sighting twice", [](LineMap* m) { m->sightings[1].key_frame = m->sightings[0].key_frame; }},
      {"direction of length 2", [](LineMap* m) { m->sightings[0].direction_to_camera *= 2.0f; }},
      {"negative distance", [](LineMap* m) { m->sightings[0].distance_m = -1.0f; }},
      {"quaternion of length 2",
       [](LineMap* m) { m->key_frames[1].cam_from_world.rotation.coeffs() *= 2.0; }},
      {"NaN translation",
       [](LineMap* m) { m->key_frames[1].cam_from_world.translation.x() = kNan; }},
      {"focal length 0", [](LineMap* m) { m->key_frames[0].camera.fx = 0.0; }},
      {"negative image", [](LineMap* m) { m->key_frames[0].camera.width_px = -640; }},
      {"segment of an unknown line", [](LineMap* m) { m->key_frames[0].segments[0].line = 3; }},
      {"NaN score", [](LineMap* m) { m->key_frames[0].segments[0].segment_px.score = kNan; }},
      {"NaN point", [](LineMap* m) { m->key_frames[0].points[0].pixel.x() = std::nanf(""); }},
  };
  for (const auto& c : cases) {
    LineMap map = MakeRandomMap({3, 2, 2, 1}, /*seed=*/10);
    c.spoil(&map);
    std::filesystem::remove_all(path_);
    WriteUnchecked(map, path_);
    const Result<LineMap> read = ReadMap(path_);
    ASSERT_FALSE(read) << c.what;
    EXPECT_EQ(read.error().code, ErrorCode::kCorruptData) << c.what;

    std::filesystem::remove_all(path_);
    const Status written = WriteMap(map, path_);
    ASSERT_FALSE(written) << c.what;
    EXPECT_EQ(written.error().code, ErrorCode::kInvalidArgument) << c.what;
    EXPECT_THAT(root_.Names(), IsEmpty()) << c.what;
  }
}

TEST_F(MapFileTest, RefusesALineThatLosesItsLengthToRounding) {
  LineMap map = MakeRandomMap({1, 1, 0, 0}, /*seed=*/11);
  map.lines[0].segment_in_world.start = {1000.0, 0.0, 0.0};
  map.lines[0].segment_in_world.end = {1000.0 + 1e-9, 0.0, 0.0};
  ASSERT_TRUE(CheckMap(map));
  EXPECT_FALSE(WriteMap(map, path_));
  EXPECT_THAT(root_.Names(), IsEmpty());
}

TEST_F(MapFileTest, FollowsNoLinkInsideTheMap) {
  for (const std::string& name : {std::string("manifest.json"), std::string("tiles/lines.plt")}) {
    std::filesystem::remove_all(path_);
    ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/12), path_));
    std::filesystem::rename(path_ + "/" + name, root_ / "elsewhere");
    std::filesystem::create_symlink(root_ / "elsewhere", path_ + "/" + name);
    const Result<LineMap> read = ReadMap(path_);
    ASSERT_FALSE(read) << name;
    EXPECT_EQ(read.error().code, ErrorCode::kCorruptData) << name;
  }
  std::filesystem::remove_all(path_);
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/12), path_));
  std::filesystem::rename(path_ + "/tiles", root_ / "tiles");
  std::filesystem::create_directory_symlink(root_ / "tiles", path_ + "/tiles");
  EXPECT_FALSE(ReadMap(path_)) << "tiles";
}

TEST_F(MapFileTest, DoesNotWaitForAPipeInThePlaceOfATile) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/13), path_));
  ASSERT_EQ(unlink((path_ + "/tiles/lines.plt").c_str()), 0);
  ASSERT_EQ(mkfifo((path_ + "/tiles/lines.plt").c_str(), 0600), 0);
  EXPECT_EQ(ReadMap(path_).error().code, ErrorCode::kCorruptData);
}

TEST_F(MapFileTest, ReadsAMapThroughALinkToItsDirectory) {
  ASSERT_TRUE(WriteMap(MakeRandomMap({2, 2, 2, 1}, /*seed=*/14), path_));
  std::filesystem::create_directory_symlink(path_, root_ / "link");
  EXPECT_TRUE(ReadMap(root_ / "link"));
}

TEST_F(MapFileTest, LeavesAnExistingMapAloneUnlessToldToReplaceIt) {
  const LineMap old_map = MakeRandomMap({2, 2, 2, 1}, /*seed=*/15);
  const LineMap new_map = MakeRandomMap({5, 3, 2, 1}, /*seed=*/16);
  ASSERT_TRUE(WriteMap(old_map, path_));
  const Status refused = WriteMap(new_map, path_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("exists"));
  EXPECT_EQ(ReadMap(path_)->lines.size(), 2u);
  EXPECT_THAT(root_.Names(), ElementsAre("map"));

  ASSERT_TRUE(WriteMap(new_map, path_, {.overwrite = true}));
  EXPECT_EQ(ReadMap(path_)->lines.size(), 5u);
  EXPECT_THAT(root_.Names(), ElementsAre("map"));
}

TEST_F(MapFileTest, OnlyItsOwnFilesBelongToAMap) {
  ASSERT_TRUE(WriteMap(LineMap{}, path_));
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) {
    const std::string name = entry.path().lexically_relative(path_).string();
    EXPECT_TRUE(IsMapFile(entry.is_directory() ? name + "/" : name)) << name;
  }
  for (const char* name : {"", "README.txt", "tiles", "tiles/a.txt", "tiles/a/b.plt", "a.plt"}) {
    EXPECT_FALSE(IsMapFile(name)) << name;
  }
}

TEST_F(MapFileTest, ReplacesAnEmptyDirectoryOnlyWhenToldTo) {
  std::filesystem::create_directory(path_);
  EXPECT_FALSE(WriteMap(LineMap{}, path_));
  EXPECT_TRUE(WriteMap(LineMap{}, path_, {.overwrite = true}));
  EXPECT_TRUE(ReadMap(path_));
  EXPECT_THAT(root_.Names(), ElementsAre("map"));
}

TEST_F(MapFileTest, NeverReplacesWhatIsNotAMap) {
  std::filesystem::create_directory(path_);
  Spill(path_ + "/thesis.txt", "years of work");
  const Status status = WriteMap(LineMap{}, path_, {.overwrite = true});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(Slurp(path_ + "/thesis.txt"), "years of work");

  Spill(root_ / "file", "text");
  EXPECT_FALSE(WriteMap(LineMap{}, root_ / "file", {.overwrite = true}));
  EXPECT_EQ(Slurp(root_ / "file"), "text");
  std::filesystem::create_symlink("nowhere", root_ / "dangling");
  EXPECT_FALSE(WriteMap(LineMap{}, root_ / "dangling", {.overwrite = true}));
  EXPECT_EQ(root_.Names().size(), 3u);
}

TEST_F(MapFileTest, SaysThatTheParentDoesNotExist) {
  const Status status = WriteMap(LineMap{}, root_ / "a/b");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(root_.Names(), IsEmpty());
}

TEST_F(MapFileTest, RefusesATargetWithoutName) {
  EXPECT_FALSE(WriteMap(LineMap{}, ""));
  EXPECT_FALSE(WriteMap(LineMap{}, "///"));
}

TEST_F(MapFileTest, LeavesNothingWhereItMayNotWrite) {
  // /proc refuses new directories even to root.
  const Status status = WriteMap(LineMap{}, "/proc/plumb-map");
  ASSERT_FALSE(status);
  EXPECT_FALSE(std::filesystem::exists("/proc/plumb-map"));
}

TEST_F(MapFileTest, AcceptsATrailingSlash) {
  ASSERT_TRUE(WriteMap(LineMap{}, path_ + "/"));
  EXPECT_TRUE(ReadMap(path_ + "/"));
  EXPECT_THAT(root_.Names(), ElementsAre("map"));
}

TEST_F(MapFileTest, WritesFilesThatOthersMayRead) {
  const mode_t mask = umask(022);
  ASSERT_TRUE(WriteMap(LineMap{}, path_));
  umask(mask);
  struct stat info = {};
  ASSERT_EQ(stat((path_ + "/manifest.json").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0644u);
  ASSERT_EQ(stat(path_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0755u);
}

}  // namespace
}  // namespace plumb
