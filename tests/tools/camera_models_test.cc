// Rooms seen through lenses, from the rendered sequence to refined poses: as accurate as without.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/program_run.h"

namespace plumb::tools {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::ProgramRun;
using testing::ReadAll;
using testing::RunPlumbline;
using testing::TemporaryDirectory;

constexpr int kNumFrames = 9;

struct Errors {
  double median_cm = 0.0, median_deg = 0.0, p90_cm = 0.0;
  json status;
};

/// Renders rooms with other cameras, builds maps of every third frame and refines the others.
class CameraModels : public ::testing::Test {
 protected:
  void Synth(const std::string& name, const std::string& camera, int num_frames = kNumFrames) {
    const ProgramRun run = RunPlumbline("synth --seed 2 --frames " + std::to_string(num_frames) +
                                        " --sweep 20 --width 320 --height 240 --samples 2 " +
                                        camera + " --out " + (dir_ / name));
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  void Build(const std::string& name, const std::string& extra = "") {
    const ProgramRun run = RunPlumbline("map build --sequence " + (dir_ / name) + " --frames " +
                                        (dir_ / (name + "/splits/map.txt")) +
                                        " --model lsd --out " + (dir_ / "map") + " " + extra);
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  Errors Refine(const std::string& name, const std::string& extra = "") {
    const std::string room = dir_ / name, priors = room + "/splits/prior_p05.txt";
    const ProgramRun run = RunPlumbline(
        "replay --sequence " + room + " --frames " + room + "/splits/query.txt --priors " + priors +
        " --map " + (dir_ / "map") + " --model lsd --prior-size 5,1 --overlays 1 " + extra +
        " --json --out " + (dir_ / "run"));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const ProgramRun eval = RunPlumbline("eval trajectory --run " + (dir_ / "run") + " --truth " +
                                         room + "/groundtruth.txt --priors " + priors + " --json");
    EXPECT_EQ(eval.exit_code, 0) << eval.err;
    if (run.exit_code != 0 || eval.exit_code != 0) return {};
    const json report = json::parse(eval.out);
    Errors errors{report["refined"]["median_cm"], report["refined"]["median_deg"],
                  report["refined"]["p90_cm"], report["status"]};
    return errors;
  }

  TemporaryDirectory dir_;
};

TEST_F(CameraModels, PosesAreAsAccurateAsAPinholes) {
  const std::pair<const char*, const char*> cameras[] = {
      {"pinhole", "--focal 200"},
      {"radtan4", "--focal 200 --camera-model RADTAN --distortion=-0.3,0.1,0.001,-0.001"},
      {"radtan5", "--focal 200 --camera-model RADTAN --distortion=-0.28,0.12,0,0.0005,-0.02"},
      {"radtan8",
       "--focal 200 --camera-model RADTAN --distortion=0.2,0.05,0.001,0,0.01,0.45,0.12,0.02"},
      {"fisheye", "--focal 130 --camera-model KANNALA_BRANDT --distortion=-0.02,0.005,-0.001,0"}};
  Errors pinhole;
  for (const auto& [name, camera] : cameras) {
    Synth(name, camera);
    Build(name);
    const Errors errors = Refine(name);
    EXPECT_EQ(errors.status["REFINED"], 6) << name;
    if (std::string(name) == "pinhole") pinhole = errors;
    // Six small frames: medians of one camera differ by half from seed to seed.
    EXPECT_LT(errors.median_cm, 2.0 * pinhole.median_cm + 0.05) << name;
    EXPECT_LT(errors.median_deg, 2.0 * pinhole.median_deg + 0.01) << name;
  }
}

TEST_F(CameraModels, AMapServesCamerasOfEveryKind) {
  Synth("pinhole", "--focal 200");
  Synth("radtan", "--focal 200 --camera-model RADTAN --distortion=-0.3,0.1,0.001,-0.001");
  Build("pinhole");
  EXPECT_EQ(Refine("radtan").status["REFINED"], 6);
  Build("radtan");
  const Errors errors = Refine("pinhole");
  EXPECT_EQ(errors.status["REFINED"], 6);
  EXPECT_LT(errors.p90_cm, 0.5);
  // Points too: their places and depths are those of the distorted images.
  EXPECT_LT(Refine("radtan", "--points opencv").p90_cm, 0.5);
}

// The images have a lens that camera.json does not know: key frames show it, queries gain.
TEST_F(CameraModels, ALensThatIsNotGivenIsFound) {
  const std::string room = dir_ / "room";
  const ProgramRun synth = RunPlumbline(
      "synth --seed 2 --frames 36 --sweep 60 --map-every 2 --width 480 --height 360 --focal 360 "
      "--samples 1 --camera-model RADTAN --distortion=0.03,-0.06,0,0 --out " +
      room);
  ASSERT_EQ(synth.exit_code, 0) << synth.err;
  json camera = json::parse(ReadAll(room + "/camera.json"));
  camera["model"] = "PINHOLE";
  camera.erase("distortion_coefficients");
  dir_.Write("room/camera.json", camera.dump());

  Build("room", "--camera given");
  const json given_info = json::parse(RunPlumbline("map info --json " + (dir_ / "map")).out);
  EXPECT_FALSE(given_info.contains("camera_lens"));
  const Errors given = Refine("room");
  Build("room");
  const json info = json::parse(RunPlumbline("map info --json " + (dir_ / "map")).out);
  ASSERT_EQ(info["camera_lens"], "RADTAN");
  EXPECT_NEAR(info["camera_fx_fy_cx_cy"][0].get<double>(), 360.0, 2.0);
  EXPECT_GT(info["camera_shift_px"].get<double>(), 1.0);
  const Errors found = Refine("room");
  EXPECT_LT(found.median_cm, 0.7 * given.median_cm);
  EXPECT_LT(found.median_deg, 0.7 * given.median_deg);
}

TEST_F(CameraModels, TheOtherCommandsTakeThem) {
  Synth("room", "--focal 200 --camera-model RADTAN --distortion=-0.3,0.1,0,0");
  Build("room");
  const std::string room = dir_ / "room";
  const std::string arguments = " --sequence " + room + " --frames " + room +
                                "/splits/query.txt --priors " + room +
                                "/splits/prior_p05.txt --map " + (dir_ / "map") + " --model lsd";
  for (const char* command :
       {"bench frame", "bench refine", "eval controls", "replay --mode stream --overlays 0"}) {
    const std::string out =
        std::string(command).starts_with("replay") ? " --out " + (dir_ / "run") : std::string();
    const ProgramRun run = RunPlumbline(command + arguments + out + " --json");
    EXPECT_EQ(run.exit_code, 0) << command << ": " << run.err;
  }
  const ProgramRun repeatability =
      RunPlumbline("eval repeatability --sequence " + room + " --frames " + room +
                   "/splits/map.txt --step 2 --model lsd --json");
  ASSERT_EQ(repeatability.exit_code, 0) << repeatability.err;
  const json report = json::parse(repeatability.out);
  EXPECT_GT(report["refined"]["found_again"].get<double>(), 0.6);
  EXPECT_LT(report["refined"]["error_px"]["median"].get<double>(), 0.2);
}

TEST_F(CameraModels, BadCoefficientsAreNamedWithTheirFile) {
  Synth("room", "--focal 200 --camera-model RADTAN --distortion=-0.3,0.1,0,0", 2);
  const std::string path = dir_ / "room/camera.json";
  json camera = json::parse(ReadAll(path));
  camera["distortion_coefficients"] = {-0.3, 0.1, 0.0};
  dir_.Write("room/camera.json", camera.dump());
  const ProgramRun run =
      RunPlumbline("map build --sequence " + (dir_ / "room") + " --frames " +
                   (dir_ / "room/splits/map.txt") + " --model lsd --out " + (dir_ / "map"));
  EXPECT_EQ(run.exit_code, 65);
  EXPECT_THAT(run.err, HasSubstr(path));
  EXPECT_THAT(run.err, HasSubstr("\"distortion_coefficients\" is [-0.3,0.1,0.0]"));
}

TEST_F(CameraModels, SynthRefusesALensThatItCannotMake) {
  for (const char* lens :
       {"--camera-model RADTAN", "--camera-model RADTAN --distortion=1,2,3",
        "--distortion=0.1,0,0,0", "--camera-model KANNALA_BRANDT --distortion=0,0,0,0,0",
        "--camera-model FISH --distortion=0,0,0,0"}) {
    const ProgramRun run =
        RunPlumbline(std::string("synth --frames 2 --out ") + (dir_ / "room") + " " + lens);
    EXPECT_EQ(run.exit_code, 64) << lens << ": " << run.err;
  }
}

}  // namespace
}  // namespace plumb::tools
