// Maps without depth images, from a sequence and from COLMAP models, and poses refined with them.
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/colmap_files.h"
#include "tests/tools/program_run.h"
#include "tests/tools/small_room.h"
#include "tools/datasets/tum_sequence.h"

namespace plumb::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::AsColmapBinary;
using testing::AsColmapText;
using testing::ColmapFiles;
using ::testing::HasSubstr;
using testing::ProgramRun;
using testing::RunPlumbline;
using testing::TemporaryDirectory;

constexpr int kNumFrames = 24, kNumMapFrames = 8;

/// A small rendered room whose depth images are gone.
class ViewsMap : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    room_ = new TemporaryDirectory;
    synth::SequenceOptions options = testing::SmallRoom(kNumFrames, 40.0);
    options.shadows = false;
    options.lens = *MakeLens(LensModel::kRadTan, std::vector<double>{-0.1, 0.02, 0.001, -0.001});
    const Status written = synth::WriteSequence(options, room_->path(), {});
    ASSERT_TRUE(written) << written.error().message;
    fs::remove_all(*room_ / "depth");
  }
  static void TearDownTestSuite() {
    delete room_;
    room_ = nullptr;
  }

  static std::string Frames(const std::string& split) { return *room_ / ("splits/" + split); }
  static std::string FromSequence() {
    return "map build --sequence " + room_->path() + " --frames " + Frames("map.txt") +
           " --model lsd --json --depth views";
  }

  /// The map frames as a COLMAP model with one camera each, as COLMAP makes them by default.
  static ColmapFiles AsColmap(bool binary) {
    const Result<TumSequence> sequence = ReadTumSequence(room_->path());
    const auto frames = SelectFrames(*sequence, Frames("map.txt"));
    const ImageCamera& camera = sequence->rectifier.image_camera();
    const Camera& p = camera.pinhole;
    const auto& k = camera.lens.coefficients;
    std::vector<testing::ColmapFileCamera> cameras;
    std::vector<testing::ColmapFileImage> images;
    for (const SequenceFrame& frame : *frames) {
      const auto id = static_cast<uint32_t>(cameras.size() + 1);
      cameras.push_back({id,
                         4,
                         "OPENCV",
                         static_cast<uint64_t>(p.width_px),
                         static_cast<uint64_t>(p.height_px),
                         {p.fx, p.fy, p.cx + 0.5, p.cy + 0.5, k[0], k[1], k[2], k[3]}});
      images.push_back({id, *frame.cam_from_world, id,
                        fs::path(frame.color_path).lexically_relative(*room_ / "rgb").string(), 5});
    }
    return binary ? AsColmapBinary(cameras, images) : AsColmapText(cameras, images);
  }
  std::string WriteColmap(bool binary) const {
    const ColmapFiles files = AsColmap(binary);
    const std::string ending = binary ? ".bin" : ".txt";
    dir_.Write("sparse/cameras" + ending, files.cameras);
    dir_.Write("sparse/images" + ending, files.images);
    return "map build --colmap " + (dir_ / "sparse") + " --images " + (*room_ / "rgb") +
           " --model lsd --json";
  }

  json Info(const std::string& map) const {
    return json::parse(RunPlumbline("map info " + map + " --json").out);
  }
  void ExpectRefines(const std::string& map) const {
    const std::string priors = Frames("prior_p05.txt");
    const ProgramRun run =
        RunPlumbline("replay --sequence " + room_->path() + " --frames " + Frames("query.txt") +
                     " --priors " + priors + " --map " + map +
                     " --model lsd --prior-size 5,1 --overlays 0 --json --out " + (dir_ / "run"));
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const ProgramRun eval =
        RunPlumbline("eval trajectory --run " + (dir_ / "run") + " --truth " +
                     (*room_ / "groundtruth.txt") + " --priors " + priors + " --json");
    ASSERT_EQ(eval.exit_code, 0) << eval.err;
    const json report = json::parse(eval.out);
    EXPECT_GE(report["status"]["REFINED"].get<int>(), (kNumFrames - kNumMapFrames) * 9 / 10);
    EXPECT_LT(report["refined"]["median_cm"].get<double>(), 0.5);
    fs::remove_all(dir_ / "run");
  }

  static TemporaryDirectory* room_;
  TemporaryDirectory dir_;
};

TemporaryDirectory* ViewsMap::room_ = nullptr;

TEST_F(ViewsMap, ASequenceWithoutDepthImagesGivesAMapThatRefines) {
  const ProgramRun run = RunPlumbline(FromSequence() + " --out " + (dir_ / "map"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(json::parse(run.out)["depth"], "views");
  const json info = Info(dir_ / "map");
  EXPECT_EQ(info["depth"], "views");
  EXPECT_EQ(info["key_frames"], kNumMapFrames);
  EXPECT_GT(info["lines"].get<int>(), 50);
  EXPECT_EQ(info["lines"], info["multi_view_lines"]);
  EXPECT_EQ(info["points"], 0);
  ExpectRefines(dir_ / "map");
}

TEST_F(ViewsMap, WithDepthTheMissingImagesAreNamed) {
  const ProgramRun run = RunPlumbline("map build --sequence " + room_->path() + " --frames " +
                                      Frames("map.txt") + " --model lsd --out " + (dir_ / "map"));
  EXPECT_EQ(run.exit_code, 66);
  EXPECT_THAT(run.err, HasSubstr("depth image"));
}

TEST_F(ViewsMap, AColmapModelGivesTheMapOfTheSequence) {
  const ProgramRun plain = RunPlumbline(FromSequence() + " --out " + (dir_ / "map"));
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  const json expected = Info(dir_ / "map");
  for (const bool binary : {false, true}) {
    const std::string map = dir_ / (binary ? "binary" : "text");
    const ProgramRun run = RunPlumbline(WriteColmap(binary) + " --out " + map);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const json info = Info(map);
    EXPECT_EQ(info["depth"], "views");
    EXPECT_EQ(info["lines"], expected["lines"]);
    EXPECT_EQ(info["segments"], expected["segments"]);
    EXPECT_NEAR(info["length_m"].get<double>(), expected["length_m"].get<double>(), 0.01);
    ExpectRefines(map);
  }
}

TEST_F(ViewsMap, WrongUsageSaysWhatIsWanted) {
  const std::string out = " --model lsd --out " + (dir_ / "map");
  const std::pair<std::string, const char*> cases[] = {
      {"--colmap x", "--images"},
      {"--images x", "--colmap"},
      {"--sequence x", "--frames"},
      {"", "--sequence"},
      {"--colmap x --images y --sequence z --frames w", "either"},
      {"--colmap x --images y --depth sensor", "--sequence"},
      {"--colmap x --images y --points opencv", "--points"},
      {"--sequence x --frames y --depth views --points opencv", "--points"},
      {"--sequence x --frames y --depth views --adjust-poses", "--adjust-poses"}};
  for (const auto& [arguments, what] : cases) {
    const ProgramRun run = RunPlumbline("map build " + arguments + out);
    EXPECT_EQ(run.exit_code, 64) << arguments;
    EXPECT_THAT(run.err, HasSubstr(what)) << arguments;
  }
}

TEST_F(ViewsMap, MissingModelsAndImagesAreMissing) {
  const ProgramRun no_model =
      RunPlumbline("map build --model lsd --colmap " + (dir_ / "no") + " --images " +
                   (*room_ / "rgb") + " --out " + (dir_ / "map"));
  EXPECT_EQ(no_model.exit_code, 66);
  EXPECT_THAT(no_model.err, HasSubstr("no COLMAP model"));
  WriteColmap(true);
  const ProgramRun no_images =
      RunPlumbline("map build --model lsd --colmap " + (dir_ / "sparse") + " --images " +
                   (dir_ / "no") + " --out " + (dir_ / "map"));
  EXPECT_EQ(no_images.exit_code, 66);
  EXPECT_THAT(no_images.err, HasSubstr(dir_ / "no/"));
}

}  // namespace
}  // namespace plumb::tools
