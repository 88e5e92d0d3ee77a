// Readers of data sets: timestamps, trajectories, sequences, images, annotations.
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/tools/temporary_directory.h"
#include "tools/datasets/camera_file.h"
#include "tools/datasets/image_file.h"
#include "tools/datasets/line_annotations.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"
#include "tools/datasets/tum_sequence.h"

namespace plumb::tools {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryDirectory;

constexpr const char* kCamera =
    R"({"model": "PINHOLE", "width": 4, "height": 2, "fx": 3.5, "fy": -3, "cx": 1.5, "cy": 0.5,
        "depth_scale": 5000})";

TEST(Timestamp, KeepsNanosecondsThatADoubleLoses) {
  EXPECT_EQ(*ParseTimestamp("1305031102.175304001"), 1305031102175304001);
  EXPECT_EQ(FormatTimestamp(1305031102175304001), "1305031102.175304001");
}

TEST(Timestamp, ReadsPlainDecimals) {
  EXPECT_EQ(*ParseTimestamp("0"), 0);
  EXPECT_EQ(*ParseTimestamp("12."), 12'000'000'000);
  EXPECT_EQ(*ParseTimestamp("0.0666670000000"), 66'667'000);
  EXPECT_EQ(*ParseTimestamp("-1.5"), -1'500'000'000);
}

TEST(Timestamp, RefusesWhatIsNotExact) {
  for (const char* text :
       {"", "-", ".5", "1e9", "nan", "1.0x", "1.2.3", "0.0000000001", "9000000000.000000001",
        "-9000000001", "9223372036", "99999999999999999999"}) {
    EXPECT_FALSE(ParseTimestamp(text)) << text;
  }
}

TEST(Timestamp, FormatIsTheInverse) {
  for (const int64_t ns : {int64_t{0}, int64_t{-1}, int64_t{66'667'000}, int64_t{-2'500'000'000},
                           int64_t{-9'000'000'000'000'000'000}}) {
    EXPECT_EQ(*ParseTimestamp(FormatTimestamp(ns)), ns);
  }
  EXPECT_EQ(FormatTimestamp(66'667'000), "0.066667");
}

TEST(TumTrajectory, IsCameraToWorldInTheFileAndCamFromWorldInMemory) {
  const TemporaryDirectory dir;
  // Camera at (1, 2, 3), turned by 90 degrees about z.
  const std::string path = dir.Write(
      "poses.txt", "# comment\n\n 2.5 1 2 3 0 0 0.70710678118654757 0.70710678118654757\r\n");
  const Result<Trajectory> trajectory = ReadTumTrajectory(path);
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  ASSERT_EQ(trajectory->size(), 1u);
  const StampedPose& pose = trajectory->front();
  EXPECT_EQ(pose.timestamp_ns, 2'500'000'000);
  EXPECT_TRUE(pose.cam_from_world.Center().isApprox(Eigen::Vector3d(1, 2, 3), 1e-12));
  // The camera's x axis points along the world's y axis.
  EXPECT_TRUE(
      (pose.cam_from_world * Eigen::Vector3d(1, 3, 3)).isApprox(Eigen::Vector3d(1, 0, 0), 1e-12));
}

TEST(TumTrajectory, SurvivesWritingAndReadingToTheLastBits) {
  const TemporaryDirectory dir;
  Trajectory written;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d w(0.1 * i, -0.03 * i, 0.7);
    written.push_back({1'000'000'007LL * i, {ExpSo3(w), Eigen::Vector3d(1.0 / 3, -i, 1e-9 * i)}});
  }
  const Result<Trajectory> read =
      ReadTumTrajectory(dir.Write("t.txt", FormatTumTrajectory(written)));
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), written.size());
  for (size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ((*read)[i].timestamp_ns, written[i].timestamp_ns);
    const PoseDistance off = DistanceBetween((*read)[i].cam_from_world, written[i].cam_from_world);
    EXPECT_LT(off.position_m, 1e-13);
    EXPECT_LT(off.rotation_rad, 1e-7);
  }
}

TEST(TumTrajectory, IsSortedByTime) {
  const TemporaryDirectory dir;
  const Result<Trajectory> read =
      ReadTumTrajectory(dir.Write("t.txt", "2 0 0 0 0 0 0 1\n1 9 0 0 0 0 0 1\n"));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->front().timestamp_ns, 1'000'000'000);
  EXPECT_DOUBLE_EQ(read->front().cam_from_world.translation.x(), -9.0);
}

TEST(TumTrajectory, NamesFileLineAndValueOfWhatIsWrong) {
  const TemporaryDirectory dir;
  const std::string good = "# poses\n1 0 0 0 0 0 0 1\n";
  const struct {
    const char* line;
    const char* message;
  } cases[] = {{"2 nan 0 0 0 0 0 1", "\"nan\" is not finite"},
               {"2 0 0 inf 0 0 0 1", "\"inf\" is not finite"},
               {"2 0 0 0 0 0 0", "7 fields"},
               {"2 0 0 0 0 0 0 1 1", "9 fields"},
               {"2 0 x 0 0 0 0 1", "\"x\" is not a number"},
               {"2 0 0 1e8 0 0 0 1", "more than 1e7 m from the origin"},
               {"9000000001 0 0 0 0 0 0 1", "\"9000000001\" is beyond 9e9 s"},
               {"2 0 0 0 0 0 0 0.9", "norm is 0.9"},
               {"2 0 0 0 0 0 0 0", "norm is 0.0"},
               {"2s 0 0 0 0 0 0 1", "\"2s\" is not a timestamp"},
               {"1.0 0 0 0 0 0 0 1", "given in line 2 already"}};
  for (const auto& c : cases) {
    const std::string path = dir.Write("t.txt", good + c.line + "\n");
    const Result<Trajectory> read = ReadTumTrajectory(path);
    ASSERT_FALSE(read) << c.line;
    EXPECT_EQ(read.error().code, ErrorCode::kCorruptData);
    EXPECT_THAT(read.error().message, HasSubstr(path + ":3: "));
    EXPECT_THAT(read.error().message, HasSubstr(c.message));
  }
}

TEST(TumTrajectory, MissingAndEmptyFilesAreDifferentErrors) {
  const TemporaryDirectory dir;
  EXPECT_EQ(ReadTumTrajectory(dir / "none.txt").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadTumTrajectory(dir.path()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadTumTrajectory(dir.Write("e.txt", "# nothing\n")).error().code,
            ErrorCode::kCorruptData);
}

TEST(PoseAt, InterpolatesTheCentreAndTheRotation) {
  const double quarter = std::numbers::pi / 4;
  const Rigid3 a_from_world{ExpSo3({0, 0, 0}), {0, 0, 0}};
  const Rigid3 world_from_b{ExpSo3({0, 0, 2 * quarter}), {4, 0, 0}};
  const Trajectory trajectory{{0, a_from_world}, {40'000'000, world_from_b.Inverse()}};
  const auto middle = PoseAt(trajectory, 20'000'000);
  ASSERT_TRUE(middle);
  EXPECT_TRUE(middle->Center().isApprox(Eigen::Vector3d(2, 0, 0), 1e-12));
  EXPECT_NEAR(LogSo3(middle->rotation).z(), -quarter, 1e-12);
}

TEST(PoseAt, InventsNothingOutsideOrInAGap) {
  const Trajectory trajectory{{0, {}}, {60'000'000, {}}};
  EXPECT_TRUE(PoseAt(trajectory, 0));
  EXPECT_FALSE(PoseAt(trajectory, 30'000'000));
  EXPECT_FALSE(PoseAt(trajectory, -10'000));
  EXPECT_FALSE(PoseAt(trajectory, 60'010'000));
  EXPECT_FALSE(PoseAt(Trajectory{}, 0));
}

TEST(NearestPose, TakesTheEarlierAtATieAndKeepsTheTolerance) {
  const Trajectory trajectory{{0, {}}, {10, {}}};
  EXPECT_EQ(NearestPose(trajectory, 5, 5)->timestamp_ns, 0);
  EXPECT_EQ(NearestPose(trajectory, 6, 5)->timestamp_ns, 10);
  EXPECT_EQ(NearestPose(trajectory, 16, 5), nullptr);
}

TEST(NearestPose, TimestampsMayBeAsFarApartAsTheyCan) {
  constexpr int64_t kFar = 9'000'000'000'000'000'000;
  const Trajectory trajectory{{-kFar, {}}, {kFar, {}}};
  EXPECT_EQ(NearestPose(trajectory, 0, 5), nullptr);
  EXPECT_EQ(NearestPose(trajectory, kFar - 1, 5)->timestamp_ns, kFar);
  EXPECT_EQ(NearestPose(trajectory, kFar, 5)->timestamp_ns, kFar);
  EXPECT_EQ(NearestPose(trajectory, -kFar, 5)->timestamp_ns, -kFar);
  EXPECT_FALSE(PoseAt(trajectory, kFar - 1'000'000));
}

class Sequence : public ::testing::Test {
 protected:
  Sequence() {
    dir_.Write("camera.json", kCamera);
    dir_.Write("rgb.txt", "# t file\n1.0 rgb/b.png\n0.0 rgb/a.png\n2.0 rgb/c.png\n");
    dir_.Write("depth.txt",
               "0.019 depth/a.png\n0.985 depth/b.png\n1.01 depth/b2.png\n2.021 depth/c.png\n");
    dir_.Write("groundtruth.txt", "0 1 2 3 0 0 0 1\n2 4 5 6 0 0 0 1\n");
  }
  TemporaryDirectory dir_;
};

TEST_F(Sequence, AssociatesDepthAndTruthByTime) {
  const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
  ASSERT_TRUE(sequence) << sequence.error().message;
  ASSERT_EQ(sequence->frames.size(), 3u);
  EXPECT_EQ(sequence->frames[0].color_path, dir_ / "rgb/a.png");
  EXPECT_EQ(sequence->frames[0].depth_path, dir_ / "depth/a.png");
  EXPECT_EQ(sequence->frames[1].depth_path, dir_ / "depth/b2.png");
  EXPECT_FALSE(sequence->frames[2].depth_path);  // 21 ms away
  EXPECT_TRUE(sequence->frames[0].cam_from_world->Center().isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_FALSE(sequence->frames[1].cam_from_world);
  EXPECT_EQ(sequence->camera.width_px, 4);
  EXPECT_DOUBLE_EQ(sequence->camera.fy, -3.0);  // mirrored axes are kept
  EXPECT_DOUBLE_EQ(sequence->depth_scale, 5000.0);
}

TEST_F(Sequence, CameraErrorsNameTheMember) {
  const struct {
    const char* json;
    const char* message;
  } cases[] = {
      {"[]", "no JSON object"},
      {"{\"width\": 4", "no JSON object"},
      {R"({"width": 4})", "\"height\" is missing"},
      {R"({"width": 4, "height": "2"})", "\"height\" is \"2\""},
      {R"({"width": 4, "height": 2.5, "fx": 1, "fy": 1, "cx": 0, "cy": 0})", "\"height\" is 2.5"},
      {R"({"width": 4, "height": 2, "fx": 0, "fy": 1, "cx": 0, "cy": 0})", "is 0"},
      {R"({"width": 4, "height": 2, "fx": 1, "fy": 1, "cx": 0, "cy": 0})", "\"depth_scale\""},
      {R"({"width": 4, "height": 2, "fx": 1, "fy": 1, "cx": 0, "cy": 0, "depth_scale": 1e-4})",
       "\"depth_scale\" is 0.0001, want 1e-3 to 1e6"},
      {R"({"width": 4, "height": 2, "fx": 1, "fy": 1, "cx": 0, "cy": 0, "depth_scale": 1e7})",
       "\"depth_scale\" is 10000000.0, want"},
      {R"({"model": "FISHEYE"})", "\"FISHEYE\""}};
  for (const auto& c : cases) {
    dir_.Write("camera.json", c.json);
    const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
    ASSERT_FALSE(sequence) << c.json;
    EXPECT_THAT(sequence.error().message, HasSubstr(c.message)) << c.json;
  }
}

/// Many levels of nesting: what recurses over them exhausts the stack.
std::string DeepArray() { return std::string(200'000, '[') + std::string(200'000, ']'); }

TEST_F(Sequence, NestedAndLongMembersAreRefusedInAShortMessage) {
  for (const char* member : {"width", "fx", "model", "distortion_coefficients", "depth_scale"}) {
    for (const std::string& value : {DeepArray(), "\"" + std::string(5000, 'x') + "\""}) {
      const auto camera =
          ParseCameraFile("{\"" + std::string(member) + "\": " + value +
                              R"(, "width": 4, "height": 2, "fx": 1, "fy": 1, "cx": 0, "cy": 0})",
                          "camera.json", true);
      ASSERT_FALSE(camera) << member;
      EXPECT_LT(camera.error().message.size(), 240u) << member;
      EXPECT_THAT(camera.error().message, HasSubstr("camera.json: "));
    }
  }
}

TEST_F(Sequence, ReadsLensesUnderTheirNames) {
  const struct {
    const char* members;
    Lens lens;
  } cases[] = {
      {R"("model": "PINHOLE")", {}},
      {R"("model": "PINHOLE", "distortion_coefficients": [0, 0.0])", {}},
      {R"("model": "RADTAN", "distortion_coefficients": [-0.3, 0.1, 0.01, -0.02])",
       {LensModel::kRadTan, {-0.3, 0.1, 0.01, -0.02}}},
      {R"("model": "OPENCV", "distortion_coefficients": [-0.3, 0.1, 0.01, -0.02])",
       {LensModel::kRadTan, {-0.3, 0.1, 0.01, -0.02}}},
      {R"("model": "RADTAN", "distortion_coefficients": [-0.3, 0.1, 0, 0, 0.05])",
       {LensModel::kRadTan, {-0.3, 0.1, 0, 0, 0.05}}},
      {R"("model": "FULL_OPENCV", "distortion_coefficients": [0.1, 0.2, 0, 0, 0.01, 0.2, 0.1, 0.02])",
       {LensModel::kRadTan, {0.1, 0.2, 0, 0, 0.01, 0.2, 0.1, 0.02}}},
      {R"("model": "KANNALA_BRANDT", "distortion_coefficients": [0.1, 0.2, 0.3, 0.4])",
       {LensModel::kKannalaBrandt, {0.1, 0.2, 0.3, 0.4}}},
      {R"("model": "OPENCV_FISHEYE", "distortion_coefficients": [0.1, 0.2, 0.3, 0.4])",
       {LensModel::kKannalaBrandt, {0.1, 0.2, 0.3, 0.4}}}};
  for (const auto& c : cases) {
    const std::string text =
        std::string("{") + c.members +
        R"(, "width": 64, "height": 48, "fx": 60, "fy": -61, "cx": 30, "cy": 25, "depth_scale": 5000})";
    dir_.Write("camera.json", text);
    const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
    ASSERT_TRUE(sequence) << c.members << ": " << sequence.error().message;
    EXPECT_EQ(sequence->rectifier.image_camera().lens, c.lens) << c.members;
    EXPECT_EQ(sequence->rectifier.image_camera().pinhole.width_px, 64);
    EXPECT_EQ(sequence->camera, sequence->rectifier.ideal());
    // And back.
    const Result<CameraFile> again = ParseCameraFile(
        FormatCameraFile({sequence->rectifier.image_camera(), 5000.0}, "a test"), "x", true);
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again->camera, sequence->rectifier.image_camera());
    EXPECT_EQ(again->depth_scale, 5000.0);
  }
}

TEST_F(Sequence, BadLensesAreNamedByMemberAndValue) {
  const struct {
    const char* members;
    const char* message;
  } cases[] = {
      {R"("model": "RADTAN")", "\"distortion_coefficients\" is missing, RADTAN"},
      {R"("model": "RADTAN", "distortion_coefficients": [1, 2, 3])", "[1,2,3]: RADTAN has 3"},
      {R"("model": "RADTAN", "distortion_coefficients": 0.3)", "is 0.3: no array"},
      {R"("model": "RADTAN", "distortion_coefficients": [0, 0, 0, "x"])", "\"x\" is no number"},
      {R"("model": "RADTAN", "distortion_coefficients": [0, 0, 0, null])", "null is no number"},
      {R"("model": "RADTAN", "distortion_coefficients": [-1e9, 0, 0, 0])", "does not grow"},
      {R"("model": "OPENCV", "distortion_coefficients": [0, 0, 0, 0, 0])", "OPENCV has 4"},
      {R"("model": "KANNALA_BRANDT", "distortion_coefficients": [0, 0, 0])",
       "KANNALA_BRANDT has 4"},
      {R"("distortion_coefficients": [0.1, 0, 0, 0])", "[0.1,0,0,0]: PINHOLE has none"},
      {R"("model": 7)", "\"model\" is 7, known are PINHOLE RADTAN"}};
  for (const auto& c : cases) {
    dir_.Write("camera.json",
               std::string("{") + c.members +
                   R"(, "width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 30, "cy": 25,
                   "depth_scale": 5000})");
    const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
    ASSERT_FALSE(sequence) << c.members;
    EXPECT_THAT(sequence.error().message, HasSubstr(c.message)) << c.members;
    EXPECT_THAT(sequence.error().message, HasSubstr(dir_ / "camera.json"));
  }
}

TEST_F(Sequence, SelectsFramesInTheListsOrder) {
  const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
  const auto frames = SelectFrames(*sequence, dir_.Write("list.txt", "# t\n2.000000\n0.0005\n"));
  ASSERT_TRUE(frames) << frames.error().message;
  ASSERT_EQ(frames->size(), 2u);
  EXPECT_EQ((*frames)[0].timestamp_ns, 2'000'000'000);
  EXPECT_EQ((*frames)[1].timestamp_ns, 0);
}

TEST_F(Sequence, ListErrorsNameTheLine) {
  const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
  for (const auto& [text, message] :
       {std::pair("0\n0.5\n", ":2: timestamp 0.5 names no frame"),
        std::pair("0\n1\n0.0001\n", ":3: timestamp 0.0001 names the frame of line 1 again"),
        std::pair("x\n", ":1: \"x\""), std::pair("#\n", "names no frame")}) {
    const auto frames = SelectFrames(*sequence, dir_.Write("list.txt", text));
    ASSERT_FALSE(frames) << text;
    EXPECT_THAT(frames.error().message, HasSubstr(message));
  }
}

TEST_F(Sequence, MissingFilesAreFoundBeforeTheWork) {
  const Result<TumSequence> sequence = ReadTumSequence(dir_.path());
  dir_.Write("rgb/a.png", "");
  const std::vector<SequenceFrame> first{sequence->frames[0]};
  EXPECT_TRUE(CheckFilesExist(first, false));
  const Status depth = CheckFilesExist(first, true);
  ASSERT_FALSE(depth);
  EXPECT_EQ(depth.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(depth.error().message, HasSubstr("depth/a.png"));
  dir_.Write("rgb/c.png", "");
  EXPECT_THAT(CheckFilesExist({sequence->frames[2]}, true).error().message,
              HasSubstr("2.000000 has no depth"));
}

TEST_F(Sequence, NeedsImagesAndCamera) {
  std::filesystem::remove(dir_ / "rgb.txt");
  EXPECT_EQ(ReadTumSequence(dir_.path()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadTumSequence(dir_ / "nowhere").error().code, ErrorCode::kNotFound);
}

TEST(ImageFile, DepthKeepsItsSixteenBits) {
  const TemporaryDirectory dir;
  cv::imwrite(dir / "d.png", cv::Mat(2, 3, CV_16UC1, cv::Scalar(40000)));
  cv::imwrite(dir / "c.png", cv::Mat(2, 3, CV_8UC3, cv::Scalar(1, 2, 3)));
  const Result<cv::Mat> depth = ReadDepthImage(dir / "d.png");
  ASSERT_TRUE(depth);
  EXPECT_EQ(depth->at<uint16_t>(1, 2), 40000);
  EXPECT_EQ(ReadDepthImage(dir / "c.png").error().code, ErrorCode::kCorruptData);
}

TEST(ImageFile, ViewShowsTheColourImage) {
  const TemporaryDirectory dir;
  cv::imwrite(dir / "c.png", cv::Mat(2, 3, CV_8UC3, cv::Scalar(1, 2, 3)));
  const Result<cv::Mat> image = ReadColorImage(dir / "c.png");
  ASSERT_TRUE(image);
  const ImageView view = ViewOf(*image);
  EXPECT_TRUE(view.Validate());
  EXPECT_EQ(view.format, PixelFormat::kBgr8);
  EXPECT_EQ(view.width_px, 3);
  EXPECT_EQ(view.planes[0].data[2], 3);
}

TEST(ImageFile, TruncatedMissingAndEmptyFilesAreErrors) {
  const TemporaryDirectory dir;
  EXPECT_EQ(ReadColorImage(dir / "none.png").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadColorImage(dir.Write("empty.png", "")).error().code, ErrorCode::kCorruptData);
  EXPECT_EQ(ReadColorImage(dir.Write("text.png", "no image")).error().code,
            ErrorCode::kCorruptData);
}

TEST(ImageFile, AnImageThatIsCutOffAnywhereIsRefused) {
  const TemporaryDirectory dir;
  cv::Mat noise(48, 64, CV_8UC3);
  cv::randu(noise, 0, 255);
  const struct {
    const char* name;
    std::vector<int> parameters;
  } forms[] = {{"a.jpg", {}},
               {"progressive.jpg", {cv::IMWRITE_JPEG_PROGRESSIVE, 1}},
               {"restarts.jpg", {cv::IMWRITE_JPEG_RST_INTERVAL, 4}},
               {"a.png", {}}};
  for (const auto& form : forms) {
    cv::imwrite(dir / form.name, noise, form.parameters);
    const std::string bytes = testing::ReadAll(dir / form.name);
    EXPECT_TRUE(ReadColorImage(dir / form.name)) << form.name;
    // Some cameras pad their files or append further data.
    EXPECT_TRUE(ReadColorImage(dir.Write("padded", bytes + std::string(9, '\0')))) << form.name;
    EXPECT_TRUE(ReadColorImage(dir.Write("longer", bytes + "trailer"))) << form.name;
    for (const double share : {0.3, 0.5, 0.7, 0.9, 0.99}) {
      const auto size = static_cast<size_t>(share * static_cast<double>(bytes.size()));
      for (const std::string& padding : {std::string(), std::string(99, '\0')}) {
        const auto cut = ReadColorImage(dir.Write("cut", bytes.substr(0, size) + padding));
        ASSERT_FALSE(cut) << form.name << ' ' << share;
        EXPECT_EQ(cut.error().code, ErrorCode::kCorruptData);
      }
    }
  }
  const std::string bytes = testing::ReadAll(dir / "a.jpg");
  EXPECT_THAT(
      ReadColorImage(dir.Write("cut.jpg", bytes.substr(0, bytes.size() - 1))).error().message,
      HasSubstr("cut.jpg: ends before its image is complete"));
}

TEST(LineAnnotations, AreRead) {
  const TemporaryDirectory dir;
  dir.Write("annotations.json",
            R"([{"filename": "a.jpg", "width": 3, "height": 4, "lines": [[1, 2.5, 3, 4]]}])");
  const auto images = ReadLineAnnotations(dir.path());
  ASSERT_TRUE(images) << images.error().message;
  ASSERT_EQ(images->size(), 1u);
  EXPECT_EQ(images->front().path, dir / "images/a.jpg");
  EXPECT_EQ(images->front().width_px, 3);
  EXPECT_EQ(images->front().lines.front().start, Eigen::Vector2d(1, 2.5));
}

TEST(LineAnnotations, RefuseBrokenEntries) {
  const TemporaryDirectory dir;
  for (const char* json :
       {"{", "[]", "{}", "[1]", R"([{"filename": 1}])",
        R"([{"filename": "a", "width": 0, "height": 1, "lines": []}])",
        R"([{"filename": "a", "width": 1, "height": 1}])",
        R"([{"filename": "a", "width": 1, "height": 1, "lines": [[1, 2, 3]]}])",
        R"([{"filename": "a", "width": 1, "height": 1, "lines": [[1, 2, 3, null]]}])",
        R"([{"filename": "a", "width": 1, "height": 1, "lines": [[1, 2, 3, 1e300]]}])"}) {
    dir.Write("annotations.json", json);
    EXPECT_EQ(ReadLineAnnotations(dir.path()).error().code, ErrorCode::kCorruptData) << json;
  }
}

TEST(LineAnnotations, NestedFilesAreRefused) {
  const TemporaryDirectory dir;
  const std::string deep = DeepArray();
  for (const std::string& json :
       {deep, R"([{"filename": "a", "file": "a", "lines": [], "scores": )" + deep + "}]"}) {
    dir.Write("annotations.json", json);
    EXPECT_THAT(ReadLineAnnotations(dir.path()).error().message, HasSubstr("too deeply"));
    EXPECT_THAT(ReadDetections(dir / "annotations.json", {{"a", 9, 9, {}}}).error().message,
                HasSubstr("too deeply"));
  }
}

TEST(Detections, OfOneFileTwiceAreRefused) {
  const TemporaryDirectory dir;
  const std::string path =
      dir.Write("found.json", R"([{"file": "x/a.jpg", "lines": [], "scores": []},
                                  {"file": "y/a.jpg", "lines": [], "scores": []}])");
  const auto read = ReadDetections(path, {{"a.jpg", 9, 9, {}}});
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(read.error().message, HasSubstr("image 1: want every file once, a.jpg"));
}

TEST(Detections, AreReadInTheImagesOrder) {
  const TemporaryDirectory dir;
  const std::string path =
      dir.Write("found.json", R"([{"file": "other/b.jpg", "lines": [[1, 2, 3, 4], [5, 6, 7, 8]],
                         "scores": [0.5, 0.25]}, {"file": "a.jpg", "lines": [], "scores": []}])");
  const auto read = ReadDetections(path, {{"x/a.jpg", 9, 9, {}}, {"x/b.jpg", 9, 9, {}}});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE((*read)[0].empty());
  ASSERT_EQ((*read)[1].size(), 2u);
  EXPECT_EQ((*read)[1][1].end, Eigen::Vector2d(7, 8));
  EXPECT_DOUBLE_EQ((*read)[1][1].score, 0.25);
}

TEST(Detections, RefuseBrokenEntriesAndMissingImages) {
  const TemporaryDirectory dir;
  for (const char* json :
       {"{", "[]", R"([{"lines": [], "scores": []}])", R"([{"file": "a", "lines": []}])",
        R"([{"file": "a", "lines": [[1, 2, 3]], "scores": [1]}])",
        R"([{"file": "a", "lines": [[1, 2, 3, 4]], "scores": []}])",
        R"([{"file": "a", "lines": [[1, 2, 3, 4]], "scores": ["1"]}])",
        R"([{"file": "b", "lines": [], "scores": []}])"}) {
    const std::string path = dir.Write("found.json", json);
    EXPECT_EQ(ReadDetections(path, {{"a", 9, 9, {}}}).error().code, ErrorCode::kCorruptData)
        << json;
  }
}

}  // namespace
}  // namespace plumb::tools
