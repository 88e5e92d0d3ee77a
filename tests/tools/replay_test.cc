// From a posed sequence to a map, from a map and priors to refined poses, and every way to fail.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "plumb/map/line_map.h"
#include "tests/tools/program_run.h"
#include "tests/tools/small_room.h"

namespace plumb::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProgramRun;
using testing::ReadAll;
using testing::RunPlumbline;
using testing::TemporaryDirectory;

constexpr int kNumFrames = 9;
constexpr int kNumQueries = 6;

/// A small rendered room and its map, made once.
class Replay : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    room_ = new TemporaryDirectory;
    const synth::SequenceOptions options = testing::SmallRoom(kNumFrames, 20.0);
    const Status written = synth::WriteSequence(options, room_->path(), {});
    ASSERT_TRUE(written) << written.error().message;
    const ProgramRun built = RunPlumbline(BuildArguments(room_->path()) + " --out " + Map());
    ASSERT_EQ(built.exit_code, 0) << built.err;
  }
  static void TearDownTestSuite() {
    delete room_;
    room_ = nullptr;
  }

  static std::string Map() { return *room_ / "map"; }
  static std::string BuildArguments(const std::string& sequence) {
    return "map build --sequence " + sequence + " --frames " + sequence +
           "/splits/map.txt --model lsd --json";
  }
  static std::string ReplayArguments(const std::string& priors, const std::string& map) {
    return "replay --sequence " + room_->path() + " --frames " + (*room_ / "splits/query.txt") +
           " --priors " + priors + " --map " + map + " --model lsd --json";
  }
  static std::string Priors() { return *room_ / "splits/prior_p05.txt"; }

  /// What may lie in `dir` after a failure: exactly what was there before.
  static std::vector<std::string> Entries(const std::string& dir) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(dir)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  /// Runs a replay that must fail with `code`, print nothing and leave nothing.
  void ExpectFailure(const std::string& arguments, int code, const std::string& message) {
    const TemporaryDirectory out;
    const ProgramRun run = RunPlumbline(arguments + " --out " + (out / "run"));
    EXPECT_EQ(run.exit_code, code) << run.err;
    EXPECT_THAT(run.out, IsEmpty());
    EXPECT_THAT(run.err, HasSubstr(message));
    EXPECT_THAT(Entries(out.path()), IsEmpty());
  }

  /// The priors with one line edited.
  std::string EditedPriors(const std::function<std::string(int, const std::string&)>& edit) {
    std::istringstream lines(ReadAll(Priors()));
    std::string line, text;
    for (int number = 1; std::getline(lines, line); ++number) text += edit(number, line);
    return dir_.Write("priors.txt", text);
  }

  static TemporaryDirectory* room_;
  TemporaryDirectory dir_;
};
TemporaryDirectory* Replay::room_ = nullptr;

TEST_F(Replay, MapInfoCountsWhatWasBuilt) {
  const ProgramRun run = RunPlumbline("map info " + Map() + " --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json info = json::parse(run.out);
  EXPECT_EQ(info["key_frames"], kNumFrames - kNumQueries);
  EXPECT_EQ(info["detector"], "lsd");
  EXPECT_GT(info["lines"].get<int>(), 20);
  EXPECT_GT(info["points"].get<int>(), 20);
}

TEST_F(Replay, CalibrationOnTooFewKeyFramesSaysSo) {
  const ProgramRun run =
      RunPlumbline(BuildArguments(room_->path()) + " --points none --out " + (dir_ / "map"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("uncalibrated"));
  const json info = json::parse(RunPlumbline("map info " + (dir_ / "map") + " --json").out);
  EXPECT_EQ(info["covariance_factor"].get<double>(), kUncalibratedFactor);
  EXPECT_EQ(info["points"], 0);
}

TEST_F(Replay, AdjustedPosesAreReportedAndKept) {
  const std::string build =
      BuildArguments(room_->path()) + " --points none --adjust-poses --out " + (dir_ / "map");
  const ProgramRun run = RunPlumbline(build + " --pose-sigma 0.2,0.05");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_GT(report["poses_adjusted_cm"].get<double>(), 0.0);
  EXPECT_LT(report["poses_adjusted_cm"].get<double>(), 0.2);  // they were exact
  EXPECT_LE(report["line_distance_after_px"].get<double>(),
            report["line_distance_before_px"].get<double>());
  const json info = json::parse(RunPlumbline("map info " + (dir_ / "map") + " --json").out);
  EXPECT_EQ(info["poses_adjusted_cm"], report["poses_adjusted_cm"]);
  EXPECT_EQ(info["poses_adjusted_deg"], report["poses_adjusted_deg"]);
  const json plain = json::parse(RunPlumbline("map info " + Map() + " --json").out);
  EXPECT_FALSE(plain.contains("poses_adjusted_cm"));

  const ProgramRun wrong = RunPlumbline(build + " --pose-sigma 0,1");
  EXPECT_EQ(wrong.exit_code, 64);
  EXPECT_THAT(wrong.err, HasSubstr("--pose-sigma 0,1: want two positive numbers"));
}

TEST_F(Replay, PointsNeedAMapWithPoints) {
  const ProgramRun built =
      RunPlumbline(BuildArguments(room_->path()) + " --points none --out " + (dir_ / "map"));
  ASSERT_EQ(built.exit_code, 0) << built.err;
  ExpectFailure(ReplayArguments(Priors(), dir_ / "map") + " --points opencv", 65,
                "holds no points");
}

TEST_F(Replay, PointsAloneRefine) {
  std::string arguments = ReplayArguments(Priors(), Map());
  arguments.replace(arguments.find("--model lsd"), 11, "--model none");
  const ProgramRun run =
      RunPlumbline(arguments + " --points opencv --overlays 0 --out " + (dir_ / "run"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json summary = json::parse(run.out);
  EXPECT_EQ(summary["model"], "none");
  EXPECT_GT(summary["status"]["REFINED"].get<int>(), 0);
  ExpectFailure(arguments, 64, "needs --points opencv");
}

TEST_F(Replay, AblationComparesEveryVariantWithTheTruth) {
  const std::string arguments = "eval ablation --sequence " + room_->path() + " --frames " +
                                (*room_ / "splits/query.txt") + " --map " + Map() +
                                " --model lsd --points opencv --every 2 --priors " + Priors();
  const ProgramRun run = RunPlumbline(arguments + ":5,1 --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_EQ(report["frames"], kNumQueries / 2);
  ASSERT_EQ(report["rows"].size(), 9u);
  const json& product = report["rows"][4];
  EXPECT_EQ(product["features"], "lines");
  EXPECT_EQ(product["matching"], "search");
  EXPECT_EQ(product["residual"], "perpendicular");
  EXPECT_EQ(product["recall_5cm_5deg"], 1.0);
  // Every variant must be one of its own.
  EXPECT_NE(report["rows"][1]["median_cm"], report["rows"][2]["median_cm"]);
  EXPECT_NE(report["rows"][3]["median_cm"], product["median_cm"]);
  EXPECT_NE(report["rows"][7]["median_cm"], report["rows"][8]["median_cm"]);

  const ProgramRun table = RunPlumbline(arguments + ":5,1");
  EXPECT_THAT(table.out, HasSubstr("| 5,1 | joint | search | perpendicular | "));
  const ProgramRun no_size = RunPlumbline(arguments);
  EXPECT_EQ(no_size.exit_code, 64);
  EXPECT_THAT(no_size.err, HasSubstr("want FILE:CM,DEG"));
}

TEST_F(Replay, GravityHasALineForEveryFrame) {
  // Down in the camera is down in the world, turned by the priors' own rotations: nothing changes
  // much, but it must be read.
  std::string text;
  std::istringstream lines(ReadAll(Priors()));
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    double v[8];
    std::istringstream numbers(line);
    std::string stamp;
    numbers >> stamp;
    for (int i = 0; i < 7; ++i) numbers >> v[i];
    const Eigen::Vector3d down =
        Eigen::Quaterniond(v[6], v[3], v[4], v[5]).conjugate() * Eigen::Vector3d(0.0, 0.0, -9.8);
    std::ostringstream record;
    record << stamp << ' ' << down.x() << ' ' << down.y() << ' ' << down.z() << '\n';
    text += record.str();
  }
  const std::string file = dir_.Write("gravity.txt", text);
  const std::string arguments =
      ReplayArguments(Priors(), Map()) + " --overlays 0 --gravity " + file;
  const ProgramRun run =
      RunPlumbline(arguments + " --gravity-in-world 0,0,-1 --out " + (dir_ / "run"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(json::parse(run.out)["status"]["REFINED"], kNumQueries);

  ExpectFailure(arguments, 64, "--gravity-in-world");
  ExpectFailure(arguments + " --gravity-in-world 0,0,0", 64, "want a direction");
  const std::string short_file = dir_.Write("short.txt", text.substr(0, text.find('\n')));
  ExpectFailure(
      ReplayArguments(Priors(), Map()) + " --gravity-in-world 0,0,-1 --gravity " + short_file, 65,
      "has no line for frame");
  const std::string bad_file = dir_.Write("bad.txt", "1.0 0 0\n");
  ExpectFailure(
      ReplayArguments(Priors(), Map()) + " --gravity-in-world 0,0,-1 --gravity " + bad_file, 65,
      "bad.txt:1: want");
}

TEST_F(Replay, TheRightOneOfSeveralPriorsIsRefined) {
  // The priors that are right stand in the second file, for all frames but the first.
  std::istringstream lines(ReadAll(Priors()));
  std::ostringstream wrong, right;
  int num_right = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream numbers(line);
    std::string stamp, rest;
    double x = 0.0;
    numbers >> stamp >> x;
    std::getline(numbers, rest);
    wrong << stamp << ' ' << x + 1.5 << rest << '\n';
    if (num_right++ > 0) right << line << '\n';
  }
  const std::string wrong_file = dir_.Write("wrong.txt", wrong.str());
  const std::string right_file = dir_.Write("right.txt", right.str());
  const std::string arguments = ReplayArguments(wrong_file, Map()) + " --overlays 0 ";
  const ProgramRun run =
      RunPlumbline(arguments + "--more-priors " + wrong_file + ":8,2 --more-priors " + right_file +
                   " --out " + (dir_ / "run"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::istringstream frames(ReadAll(dir_ / "run/frames.jsonl"));
  int index = 0;
  for (std::string line; std::getline(frames, line); ++index) {
    const json frame = json::parse(line);
    EXPECT_EQ(frame["status"] == "REFINED", index > 0) << line;
    EXPECT_EQ(frame["prior_index"], index > 0 ? 2 : 0) << line;
  }
  EXPECT_EQ(index, kNumQueries);
  const ProgramRun eval =
      RunPlumbline("eval trajectory --run " + (dir_ / "run") + " --truth " +
                   (*room_ / "groundtruth.txt") + " --priors " + wrong_file + " --json");
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  EXPECT_LT(json::parse(eval.out)["refined"]["median_cm"].get<double>(), 1.0);

  ExpectFailure(arguments + "--more-priors " + right_file + ":0,2", 64, "--more-priors 0,2");
  ExpectFailure(arguments + "--more-priors " + (dir_ / "none.txt"), 66, "none.txt");
  ExpectFailure(arguments + "--method paper --more-priors " + right_file, 64, "one prior only");
  const std::string other = dir_.Write("other.txt", "12345.0 0 0 0 0 0 0 1\n");
  ExpectFailure(arguments + "--more-priors " + other, 65, "names none of the 6 query frames");
  std::string too_many;
  for (int k = 0; k < 9; ++k) too_many += " --more-priors " + right_file;
  ExpectFailure(arguments + too_many, 64, "9 files, at most 8");
}

TEST_F(Replay, MapExportWritesPlyAndObj) {
  for (const auto& [name, begin] : {std::pair("lines.ply", "ply\n"), std::pair("lines.obj", "")}) {
    const ProgramRun run =
        RunPlumbline("map export " + Map() + " --out " + (dir_ / name) + " --json");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const std::string bytes = ReadAll(dir_ / name);
    EXPECT_TRUE(bytes.starts_with(begin));
    EXPECT_GT(bytes.size(), 1000u);
    EXPECT_GT(json::parse(run.out)["lines"].get<int>(), 20);
  }
}

TEST_F(Replay, OverlaysCanDoWithoutTheCamerasImage) {
  size_t bytes[2] = {0, 0};
  for (const int brightness : {0, 1}) {
    const std::string out = dir_ / ("run" + std::to_string(brightness));
    const ProgramRun run =
        RunPlumbline(ReplayArguments(Priors(), Map()) + " --overlays 1 --overlay-brightness " +
                     std::to_string(brightness) + " --out " + out);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    for (const std::string& name : Entries(out)) {
      if (name.ends_with(".png")) bytes[brightness] = ReadAll(out + "/" + name).size();
    }
  }
  EXPECT_GT(bytes[0], 1000u) << "lines and caption";
  EXPECT_LT(bytes[0], bytes[1] / 2) << "Black compresses, an image does not.";
}

TEST_F(Replay, RefinesEveryFrameAndSaysHowWell) {
  const std::string out = dir_ / "run";
  const ProgramRun run = RunPlumbline(ReplayArguments(Priors(), Map()) +
                                      " --prior-size 5,1 --overlays 2 --out " + out);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(json::parse(run.out)["frames"], kNumQueries);
  EXPECT_EQ(json::parse(ReadAll(out + "/summary.json"))["frames"], kNumQueries);
  const auto count = [](const std::string& text, char c) {
    return std::count(text.begin(), text.end(), c);
  };
  EXPECT_EQ(count(ReadAll(out + "/trajectory.txt"), '\n'), kNumQueries + 1);
  EXPECT_EQ(count(ReadAll(out + "/frames.jsonl"), '\n'), kNumQueries);
  const std::vector<std::string> files = Entries(out);
  EXPECT_EQ(std::count_if(files.begin(), files.end(),
                          [](const std::string& name) { return name.ends_with(".png"); }),
            2);

  const ProgramRun eval =
      RunPlumbline("eval trajectory --run " + out + " --truth " + (*room_ / "groundtruth.txt") +
                   " --priors " + Priors() + " --json");
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  const json report = json::parse(eval.out);
  EXPECT_EQ(report["frames"], kNumQueries);
  EXPECT_NEAR(report["prior"]["median_cm"].get<double>(), 5.0, 1e-3);
  EXPECT_NEAR(report["prior"]["median_deg"].get<double>(), 1.0, 1e-3);
  EXPECT_LT(report["refined"]["median_cm"].get<double>(), 1.0);
  EXPECT_LT(report["refined"]["median_deg"].get<double>(), 0.3);
  EXPECT_EQ(report["harmed"].get<double>(), 0.0);
  EXPECT_EQ(report["normalised_error"]["frames"], report["status"]["REFINED"]);
  EXPECT_GT(report["normalised_error"]["pose"]["median"].get<double>(), 0.0);
  int num_statuses = 0;
  for (const auto& [status, n] : report["status"].items()) num_statuses += n.get<int>();
  EXPECT_EQ(num_statuses, kNumQueries);
}

TEST_F(Replay, PathsNeedNotBeUtf8) {
  const std::string map = dir_ / "m\xE4p", out = dir_ / "r\xFCn";
  fs::copy(Map(), map, fs::copy_options::recursive);
  const ProgramRun run =
      RunPlumbline(ReplayArguments(Priors(), map) + " --overlays 0 --out " + out);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(ReadAll(out + "/summary.json"), run.out);
  EXPECT_EQ(json::parse(run.out)["frames"], kNumQueries);
}

TEST_F(Replay, EqualInputsGiveEqualBytes) {
  for (const char* name : {"a", "b"}) {
    const ProgramRun run =
        RunPlumbline(ReplayArguments(Priors(), Map()) + " --overlays 0 --out " + (dir_ / name));
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  EXPECT_EQ(ReadAll(dir_ / "a/trajectory.txt"), ReadAll(dir_ / "b/trajectory.txt"));
}

TEST_F(Replay, StreamPointsAndPaperRun) {
  for (const char* extra :
       {"--mode stream", "--points opencv", "--method paper", "--method paper --points opencv"}) {
    const std::string out = dir_ / "run";  // an earlier run there is replaced
    const ProgramRun run =
        RunPlumbline(ReplayArguments(Priors(), Map()) + " --overlays 0 " + extra + " --out " + out);
    ASSERT_EQ(run.exit_code, 0) << extra << ": " << run.err;
    EXPECT_EQ(json::parse(run.out)["frames"], kNumQueries) << extra;
    EXPECT_THAT(Entries(dir_.path()), ::testing::ElementsAre("run"));
  }
}

TEST_F(Replay, BenchFrameReportsPercentilesPerStage) {
  const ProgramRun run = RunPlumbline("bench frame --sequence " + room_->path() + " --frames " +
                                      (*room_ / "splits/query.txt") + " --priors " + Priors() +
                                      " --map " + Map() + " --model lsd --warm-up 2 --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_EQ(report["frames"], kNumQueries - 2);
  EXPECT_EQ(report["mode"], "stream");
  EXPECT_GT(report["fps"].get<double>(), 0.0);
  for (const char* stage : {"detect", "ridge", "search", "match_and_refine", "total"}) {
    EXPECT_LE(report["ms"][stage]["p50"].get<double>(), report["ms"][stage]["p99"].get<double>())
        << stage;
  }
  EXPECT_GT(report["ms"]["detect"]["p50"].get<double>(), 0.0);
}

TEST_F(Replay, ANanInAPriorIsNamedByItsLine) {
  const std::string priors = EditedPriors([](int number, const std::string& line) {
    return number == 3 ? line.substr(0, line.find(' ')) + " nan 0 0 0 0 0 1\n" : line + "\n";
  });
  ExpectFailure(ReplayArguments(priors, Map()), 65, priors + ":3: \"nan\" is not finite");
}

TEST_F(Replay, PriorsThatNameNoFrameAreRefused) {
  const std::string priors = dir_.Write("other.txt", "12345.0 0 0 0 0 0 0 1\n");
  ExpectFailure(ReplayArguments(priors, Map()), 65, "names none of the 6 query frames");
}

TEST_F(Replay, AFrameWithoutAPriorIsNamed) {
  const std::string priors = EditedPriors([](int number, const std::string& line) {
    return number == 4 ? std::string() : line + "\n";
  });
  ExpectFailure(ReplayArguments(priors, Map()), 65, "no pose for 1 of the 6 frames");
}

TEST_F(Replay, MissingInputsAreMissing) {
  ExpectFailure(ReplayArguments(Priors(), dir_ / "no-map"), 66, "no-map");
  ExpectFailure(ReplayArguments(dir_ / "no-priors.txt", Map()), 66, "no-priors.txt");
}

TEST_F(Replay, BadPriorSizesAreWrongUsage) {
  for (const char* size : {"10", "10,", "0,1", "10,-2", "nan,1", "1,2,3"}) {
    ExpectFailure(ReplayArguments(Priors(), Map()) + " --prior-size " + size, 64, "--prior-size");
  }
  for (const auto& [size, message] :
       {std::pair("1e9,2", "1e+09 cm is outside 1e-07 to 100000"),
        std::pair("10,200", "200 deg is outside 1e-07 to 183"),
        std::pair("1e-12,1e-12", "1e-12 cm is outside"), std::pair("1,1e-12", "1e-12 deg is")}) {
    ExpectFailure(ReplayArguments(Priors(), Map()) + " --prior-size " + size, 64, message);
  }
  const std::string replay = ReplayArguments(Priors(), Map());
  for (const char* size : {"100000,183", "1e-7,1e-7"}) {
    EXPECT_EQ(
        RunPlumbline(replay + " --overlays 0 --out " + (dir_ / "run") + " --prior-size " + size)
            .exit_code,
        0)
        << size;
  }
}

TEST_F(Replay, TruncatedAndFlippedMapsAreBadData) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(Map())) {
    if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), Map()));
  }
  ASSERT_FALSE(files.empty());
  for (const fs::path& file : files) {
    const std::string bytes = ReadAll((fs::path(Map()) / file).string());
    for (const bool flip : {false, true}) {
      const TemporaryDirectory copy;
      fs::copy(Map(), copy / "map", fs::copy_options::recursive);
      std::string broken = flip ? bytes : bytes.substr(0, bytes.size() / 2);
      if (flip) broken[bytes.size() / 2] = static_cast<char>(broken[bytes.size() / 2] ^ 4);
      copy.Write("map/" + file.string(), broken);
      ExpectFailure(ReplayArguments(Priors(), copy / "map"), 65, "map");
    }
  }
}

TEST_F(Replay, OtherPeoplesDirectoriesAreNotReplaced) {
  dir_.Write("run/thesis.txt", "years of work");
  const ProgramRun run =
      RunPlumbline(ReplayArguments(Priors(), Map()) + " --out " + (dir_ / "run"));
  EXPECT_EQ(run.exit_code, 73);
  EXPECT_EQ(ReadAll(dir_ / "run/thesis.txt"), "years of work");
  const ProgramRun built = RunPlumbline(BuildArguments(room_->path()) + " --out " + (dir_ / "run"));
  EXPECT_EQ(built.exit_code, 73);
  EXPECT_THAT(Entries(dir_.path()), ::testing::ElementsAre("run"));
}

TEST_F(Replay, FilesBesideAnEarlierResultAreNotRemoved) {
  const std::string arguments = ReplayArguments(Priors(), Map()) + " --overlays 2 --out ";
  const std::string run = dir_ / "run", map = dir_ / "map", room = dir_ / "room";
  const std::string synth = "synth --frames 2 --width 64 --height 64 --samples 1 --out " + room;
  fs::copy(Map(), map, fs::copy_options::recursive);
  for (int k = 0; k < 2; ++k) {  // the second time they replace themselves
    ASSERT_EQ(RunPlumbline(arguments + run).exit_code, 0);
    ASSERT_EQ(RunPlumbline(synth + (k == 0 ? "" : " --png")).exit_code, 0);
  }
  EXPECT_TRUE(fs::exists(room + "/rgb/000001.png"));
  EXPECT_FALSE(fs::exists(room + "/rgb/000001.jpg"));
  const struct {
    std::string arguments, foreign;
  } cases[] = {{arguments + run, "run/overlay-best.png"},
               {synth, "room/rgb/mine.jpg"},
               // With a sequence that is missing: refused before anything is read.
               {BuildArguments(dir_ / "none") + " --out " + map, "map/README.txt"}};
  for (const auto& c : cases) {
    dir_.Write(c.foreign, "years of work");
    const ProgramRun refused = RunPlumbline(c.arguments);
    EXPECT_EQ(refused.exit_code, 73) << c.foreign << ": " << refused.err;
    EXPECT_THAT(refused.err, HasSubstr(c.foreign.substr(c.foreign.find('/') + 1)));
    EXPECT_EQ(ReadAll(dir_ / c.foreign), "years of work");
  }
}

TEST_F(Replay, OutputsNeedAnExistingParent) {
  const ProgramRun run =
      RunPlumbline(ReplayArguments(Priors(), Map()) + " --out " + (dir_ / "no/run"));
  EXPECT_EQ(run.exit_code, 73);
  EXPECT_THAT(run.err, HasSubstr("no directory"));
}

TEST_F(Replay, AMissingDepthImageStopsTheBuildAndLeavesNoMap) {
  const TemporaryDirectory copy;
  fs::copy(room_->path(), copy / "room", fs::copy_options::recursive);
  fs::remove(copy / "room/depth/000003.png");
  const ProgramRun run = RunPlumbline(BuildArguments(copy / "room") + " --out " + (dir_ / "map"));
  EXPECT_EQ(run.exit_code, 66) << run.err;
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_THAT(run.err, HasSubstr("depth/000003.png"));
  EXPECT_THAT(Entries(dir_.path()), IsEmpty());
}

TEST_F(Replay, AMapWithoutLinesReplacesNone) {
  const TemporaryDirectory copy;
  fs::copy(room_->path(), copy / "room", fs::copy_options::recursive);
  json camera = json::parse(ReadAll(copy / "room/camera.json"));
  camera["depth_scale"] = 1e-3;  // everything is farther off than depth reaches
  copy.Write("room/camera.json", camera.dump());
  fs::copy(Map(), dir_ / "map", fs::copy_options::recursive);
  const std::string build = BuildArguments(copy / "room") + " --depth sensor --out ";
  const ProgramRun run = RunPlumbline(build + (dir_ / "map"));
  EXPECT_EQ(run.exit_code, 65) << run.err;
  EXPECT_THAT(run.out, IsEmpty());
  EXPECT_THAT(run.err, ::testing::ContainsRegex("room: none of the [0-9]+ segments got a depth"));
  for (const auto& entry : fs::recursive_directory_iterator(Map())) {
    const fs::path name = fs::relative(entry.path(), Map());
    if (!entry.is_regular_file()) continue;
    EXPECT_EQ(ReadAll(dir_ / "map/" + name.string()), ReadAll(entry.path().string())) << name;
  }
}

TEST_F(Replay, ABrokenImageStopsTheReplayHalfWayAndLeavesNoRun) {
  const TemporaryDirectory copy;
  fs::copy(room_->path(), copy / "room", fs::copy_options::recursive);
  const std::string list = ReadAll(copy / "room/rgb.txt");
  const size_t begin = list.find("rgb/000005");
  ASSERT_NE(begin, std::string::npos);
  const std::string image = list.substr(begin, list.find('\n', begin) - begin);
  copy.Write("room/" + image, "no image");
  const ProgramRun run = RunPlumbline("replay --sequence " + (copy / "room") + " --frames " +
                                      (copy / "room/splits/query.txt") + " --priors " + Priors() +
                                      " --map " + Map() + " --model lsd --out " + (dir_ / "run"));
  EXPECT_EQ(run.exit_code, 65) << run.err;
  EXPECT_THAT(run.err, HasSubstr(image));
  EXPECT_THAT(Entries(dir_.path()), IsEmpty());
}

TEST_F(Replay, ControlsAreNotRefinedAndOwnSegmentsAre) {
  const ProgramRun run = RunPlumbline("eval controls --sequence " + room_->path() + " --frames " +
                                      (*room_ / "splits/query.txt") + " --priors " + Priors() +
                                      " --prior-size 5,1 --map " + Map() + " --model lsd --json");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_EQ(report["own"]["frames"], kNumQueries);
  EXPECT_EQ(report["own"]["refined"].get<double>(), 1.0);
  for (const char* control : {"mirrored", "random"}) {
    EXPECT_EQ(report[control]["frames"], kNumQueries) << control;
    EXPECT_EQ(report[control]["refined"].get<double>(), 0.0) << control;
  }
}

TEST_F(Replay, EvalNeedsARunAndMatchingTruth) {
  const std::string rest = " --truth " + (*room_ / "groundtruth.txt") + " --priors " + Priors();
  EXPECT_EQ(RunPlumbline("eval trajectory --run " + (dir_ / "none") + rest).exit_code, 66);
  dir_.Write("run/trajectory.txt", ReadAll(Priors()));
  dir_.Write("run/frames.jsonl", "{\"status\": 1}\n");
  const ProgramRun corrupt = RunPlumbline("eval trajectory --run " + (dir_ / "run") + rest);
  EXPECT_EQ(corrupt.exit_code, 65);
  EXPECT_THAT(corrupt.err, HasSubstr("frames.jsonl:1"));
  dir_.Write("run/frames.jsonl", "{\"status\": \"REFINED\", \"covariance\": " +
                                     std::string(20'000, '[') + std::string(20'000, ']') + "}\n");
  const ProgramRun nested = RunPlumbline("eval trajectory --run " + (dir_ / "run") + rest);
  EXPECT_EQ(nested.exit_code, 65);
  dir_.Write("run/frames.jsonl", "");
  const std::string truth = dir_.Write("truth.txt", "777 0 0 0 0 0 0 1\n");
  const ProgramRun apart = RunPlumbline("eval trajectory --run " + (dir_ / "run") + " --truth " +
                                        truth + " --priors " + Priors());
  EXPECT_EQ(apart.exit_code, 65);
  EXPECT_THAT(apart.err, HasSubstr("truth.txt"));
}

TEST_F(Replay, RepeatabilityOfARenderedRoomIsHigh) {
  const std::string arguments = "eval repeatability --sequence " + room_->path() + " --frames " +
                                (*room_ / "splits/map.txt") + " --model lsd --json --step ";
  const ProgramRun run = RunPlumbline(arguments + "1");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out);
  EXPECT_GE(report["pairs"].get<int>(), 2);
  EXPECT_GT(report["refined"]["expected"].get<int>(), 50);
  EXPECT_GT(report["refined"]["found_again"].get<double>(), 0.7);
  EXPECT_LT(report["refined"]["error_px"]["median"].get<double>(), 0.2);
  EXPECT_GT(report["refined"]["segments_per_view"].get<double>(), 50.0);
  const ProgramRun too_far = RunPlumbline(arguments + std::to_string(kNumFrames));
  EXPECT_EQ(too_far.exit_code, 65);
  EXPECT_THAT(too_far.out, IsEmpty());
  EXPECT_THAT(too_far.err, HasSubstr("later in the sequence"));
}

}  // namespace
}  // namespace plumb::tools
