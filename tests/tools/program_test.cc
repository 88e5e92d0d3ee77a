// The program from the command line: what it prints, which exit codes it has, how it fails.
#include <cmath>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/tools/program_run.h"

namespace plumb::tools {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProgramRun;
using testing::RunPlumbline;
using testing::TemporaryDirectory;

/// An image with one bright rectangle, (40, 30) to (120, 90).
std::string WriteRectangle(const TemporaryDirectory& dir, const std::string& name) {
  cv::Mat image(120, 160, CV_8UC3, cv::Scalar(30, 30, 30));
  cv::rectangle(image, cv::Rect(40, 30, 80, 60), cv::Scalar(220, 220, 220), cv::FILLED);
  cv::imwrite(dir / name, image);
  return dir / name;
}

TEST(Program, WithoutACommandIsWrongUsage) {
  const ProgramRun run = RunPlumbline("");
  EXPECT_EQ(run.exit_code, 64);
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_THAT(run.err, HasSubstr("subcommand"));
}

TEST(Program, EveryCommandHasHelp) {
  for (const char* command : {"",
                              "detect",
                              "map",
                              "map build",
                              "map info",
                              "map export",
                              "replay",
                              "eval",
                              "eval ablation",
                              "eval controls",
                              "eval lines",
                              "eval repeatability",
                              "eval trajectory",
                              "bench",
                              "bench net",
                              "bench frame",
                              "bench refine",
                              "synth",
                              "device",
                              "device list",
                              "version"}) {
    const ProgramRun run = RunPlumbline(std::string(command) + " --help");
    EXPECT_EQ(run.exit_code, 0) << command;
    EXPECT_THAT(run.out, HasSubstr("Usage:")) << command;
    EXPECT_THAT(run.err, IsEmpty()) << command;
  }
}

TEST(Program, WrongOptionsAreWrongUsage) {
  for (const char* arguments :
       {"detect", "detect --no-such-option", "frobnicate", "map build --sequence x",
        "replay --mode sideways", "bench net --size 100", "bench net --preset huge",
        "bench net --frames 0", "map export m --out lines.txt"}) {
    const ProgramRun run = RunPlumbline(arguments);
    EXPECT_EQ(run.exit_code, 64) << arguments << ": " << run.err;
    EXPECT_THAT(run.out, IsEmpty()) << arguments;
    EXPECT_THAT(run.err, HasSubstr("plumbline: ")) << arguments;
  }
}

TEST(Program, UnknownCommandsAreNamed) {
  for (const auto& [arguments, message] :
       {std::pair("frobnicate", "plumbline: no command 'frobnicate'"),
        std::pair("frobnicate --json", "plumbline: no command 'frobnicate'"),
        std::pair("map frobnicate x", "plumbline: map: no command 'frobnicate'"),
        std::pair("map", "subcommand")}) {
    const ProgramRun run = RunPlumbline(arguments);
    EXPECT_EQ(run.exit_code, 64) << arguments;
    EXPECT_THAT(run.err, HasSubstr(message));
  }
}

TEST(Program, NumbersWithoutAValueAreWrongUsage) {
  const std::string replay =
      "replay --sequence s --frames f --priors p --map m --out o --overlay-brightness ";
  for (const std::string& arguments :
       {replay + "nan", replay + "-nan", replay + "inf", replay + "1.5",
        replay + "1 --gravity-sigma nan", std::string("bench refine --budget-ms nan"),
        std::string("bench refine --warm-up 1000001"), std::string("detect x --min-length nan"),
        std::string("detect x --structural-nms nan"), std::string("detect x --score-threshold nan"),
        std::string("synth --out /nowhere/x --sweep nan")}) {
    const ProgramRun run = RunPlumbline(arguments);
    EXPECT_EQ(run.exit_code, 64) << arguments << ": " << run.err;
  }
  EXPECT_EQ(RunPlumbline(replay + "1 --gravity-sigma 57").exit_code, 66);
}

TEST(Program, LongWorkCanBeInterrupted) {
  const TemporaryDirectory dir;
  for (const std::string& arguments :
       {"synth --frames 100000 --width 64 --height 64 --samples 1 --out " + (dir / "room"),
        std::string("bench refine --lines 2000 --num-frames 100000 --limit 100000"),
        std::string("bench refine --lines 2000 --num-frames 1 --repeat 1 --warm-up 1000000")}) {
    const ProgramRun run = RunPlumbline(arguments, "timeout --preserve-status -s INT 2");
    EXPECT_EQ(run.exit_code, 130) << arguments << ": " << run.err;
    EXPECT_THAT(run.out, IsEmpty());
    EXPECT_THAT(run.err, HasSubstr("interrupted"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(Program, VersionIsJson) {
  const ProgramRun run = RunPlumbline("version --json");
  ASSERT_EQ(run.exit_code, 0);
  EXPECT_EQ(json::parse(run.out)["schema"], "plumb.version/1");
}

TEST(Program, DetectPrintsOneJsonDocument) {
  const TemporaryDirectory dir;
  const std::string a = WriteRectangle(dir, "a.png"), b = WriteRectangle(dir, "b.png");
  const ProgramRun run = RunPlumbline("detect " + a + " " + b + " --model lsd --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  ASSERT_EQ(report.size(), 2u);
  EXPECT_EQ(report[0]["file"], a);
  EXPECT_EQ(report[1]["file"], b);
  EXPECT_EQ(report[0]["width"], 160);
  EXPECT_EQ(report[0]["height"], 120);
  ASSERT_GE(report[0]["lines"].size(), 4u);
  EXPECT_EQ(report[0]["lines"].size(), report[0]["scores"].size());
  EXPECT_EQ(report[0]["lines"][0].size(), 4u);
  EXPECT_EQ(report[0]["lines"], report[1]["lines"]);
}

TEST(Program, RefinedSegmentsLieOnTheEdges) {
  const TemporaryDirectory dir;
  const ProgramRun run =
      RunPlumbline("detect " + WriteRectangle(dir, "a.png") + " --model lsd --refined --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json lines = json::parse(run.out)[0]["lines"];
  ASSERT_GE(lines.size(), 4u);
  for (const json& line : lines) {
    // The rectangle's edges lie between pixels: x 39.5 and 119.5, y 29.5 and 89.5.
    const auto on = [](double u, double v, double place) {
      return std::abs(u - place) < 0.3 && std::abs(v - place) < 0.3;
    };
    EXPECT_TRUE(on(line[0], line[2], 39.5) || on(line[0], line[2], 119.5) ||
                on(line[1], line[3], 29.5) || on(line[1], line[3], 89.5))
        << line;
  }
}

TEST(Program, DetectTakesOptionsForTheSegments) {
  const TemporaryDirectory dir;
  const std::string detect = "detect " + WriteRectangle(dir, "a.png") + " --model lsd --json ";
  const auto count = [&](const std::string& options) {
    const ProgramRun run = RunPlumbline(detect + options);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out)[0]["lines"].size();
  };
  EXPECT_EQ(count("--top-k 3"), 3u);
  EXPECT_EQ(count("--min-length 70"), 2u);  // the rectangle is 80 x 60 px
  EXPECT_EQ(count("--score-threshold 1"), 0u);
  EXPECT_EQ(count("--tiles 2x1"), 4u);
  EXPECT_EQ(count("--tiles auto --structural-nms 2"), 4u);
  for (const char* wrong : {"--tiles 0x2", "--tiles 2", "--tiles many", "--top-k 0",
                            "--score-threshold 2", "--min-length -1"}) {
    EXPECT_EQ(RunPlumbline(detect + wrong).exit_code, 64) << wrong;
  }
}

TEST(Program, DetectNamesTheImageThatFails) {
  const TemporaryDirectory dir;
  const ProgramRun missing = RunPlumbline("detect " + (dir / "no.png") + " --model lsd --json");
  EXPECT_EQ(missing.exit_code, 66);
  EXPECT_THAT(missing.out, IsEmpty());
  EXPECT_THAT(missing.err, HasSubstr("no.png"));
  const std::string good = WriteRectangle(dir, "a.png");
  const std::string broken = dir.Write("broken.png", testing::ReadAll(good).substr(0, 40));
  const ProgramRun corrupt = RunPlumbline("detect " + good + " " + broken + " --model lsd --json");
  EXPECT_EQ(corrupt.exit_code, 65);
  EXPECT_THAT(corrupt.out, IsEmpty());
  EXPECT_THAT(corrupt.err, HasSubstr("broken.png"));
}

TEST(Program, EvalLinesScoresAnAnnotatedFolder) {
  const TemporaryDirectory dir;
  dir.Write("images/.keep", "");
  WriteRectangle(dir, "images/a.png");
  dir.Write("annotations.json",
            R"([{"filename": "a.png", "width": 160, "height": 120, "lines":
                [[39.5, 29.5, 119.5, 29.5], [119.5, 29.5, 119.5, 89.5],
                 [119.5, 89.5, 39.5, 89.5], [39.5, 89.5, 39.5, 29.5]]}])");
  const ProgramRun run = RunPlumbline("eval lines --model lsd --data " + dir.path() + " --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_EQ(report["images"], 1);
  EXPECT_DOUBLE_EQ(report["sAP10"].get<double>(), 100.0);
  EXPECT_GT(report["ms_per_image"].get<double>(), 0.0);
  const std::string curve = "eval lines --model lsd --data " + dir.path() + " --json --curve ";
  const ProgramRun lost = RunPlumbline(curve + (dir / "no/curve.csv"));
  EXPECT_EQ(lost.exit_code, 73);
  EXPECT_EQ(json::parse(lost.out)["sAP10"], report["sAP10"]);
  EXPECT_THAT(lost.err, HasSubstr("no/curve.csv"));
  EXPECT_EQ(RunPlumbline(curve + (dir / "curve.csv")).exit_code, 0);
  EXPECT_THAT(testing::ReadAll(dir / "curve.csv"), HasSubstr("threshold,precision"));
  dir.Write("annotations.json",
            R"([{"filename": "a.png", "width": 161, "height": 120, "lines": []}])");
  const ProgramRun wrong = RunPlumbline("eval lines --model lsd --data " + dir.path() + " --json");
  EXPECT_EQ(wrong.exit_code, 65);
  EXPECT_THAT(wrong.err, HasSubstr("annotated as 161 x 120"));
}

TEST(Program, DeviceListIsJsonOrSaysThatThereIsNone) {
  const ProgramRun run = RunPlumbline("device list --json");
  if (run.exit_code == 69) GTEST_SKIP() << "no Vulkan loader: " << run.err;
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(json::parse(run.out)["devices"].is_array());
}

TEST(Program, UnknownDeviceIsNoDevice) {
  const ProgramRun run = RunPlumbline("bench net --size 64 --device no-such-device --json");
  EXPECT_EQ(run.exit_code, 69);
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_THAT(run.err, HasSubstr("no-such-device"));
}

TEST(Program, BenchNetReportsTimeAndWork) {
  const ProgramRun run = RunPlumbline("bench net --preset nano --size 64 --frames 3 --json");
  if (run.exit_code == 69) GTEST_SKIP() << "no usable device: " << run.err;
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_GT(report["median_ms"].get<double>(), 0.0);
  EXPECT_GE(report["p95_ms"].get<double>(), report["median_ms"].get<double>());
  EXPECT_GT(report["gmac"].get<double>(), 0.0);
  EXPECT_TRUE(report["device"].is_string());
}

TEST(Program, BenchRefineReportsStagesAndErrorsOnAGeneratedMap) {
  const ProgramRun run =
      RunPlumbline("bench refine --lines 2000 --num-frames 5 --warm-up 1 --hypotheses 200 --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_EQ(report["frames"], 5);
  EXPECT_EQ(report["map_lines"], 2000);
  for (const char* stage :
       {"index", "field", "score", "coarse", "fine", "local", "joint", "total"}) {
    EXPECT_GT(report["ms"][stage]["p50"].get<double>(), 0.0) << stage;
  }
  EXPECT_LT(report["error"]["median_cm"].get<double>(), 1.0);
  EXPECT_EQ(RunPlumbline("bench refine --segments lines.json").exit_code, 64);
}

TEST(Program, NetworkWeightsThatAreMissingOrCorruptAreErrors) {
  const TemporaryDirectory dir;
  const std::string image = WriteRectangle(dir, "a.png");
  const ProgramRun unknown = RunPlumbline("detect " + image + " --model no-such-preset");
  if (unknown.exit_code == 69) GTEST_SKIP() << "no usable device: " << unknown.err;
  EXPECT_EQ(unknown.exit_code, 66);
  EXPECT_THAT(unknown.err, HasSubstr("no-such-preset"));
  const std::string weights = testing::ReadAll("assets/models/nano.safetensors");
  ASSERT_FALSE(weights.empty());
  const std::string truncated =
      dir.Write("short.safetensors", weights.substr(0, weights.size() - 10));
  const ProgramRun cut = RunPlumbline("detect " + image + " --model " + truncated + " --json");
  EXPECT_EQ(cut.exit_code, 65) << cut.err;
  EXPECT_THAT(cut.out, IsEmpty());
  EXPECT_THAT(cut.err, HasSubstr("short.safetensors"));
}

}  // namespace
}  // namespace plumb::tools
