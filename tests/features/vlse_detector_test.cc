// The whole detector with a tiny random network against the chain of the CPU twins.
#include "plumb/features/vlse_detector.h"

#include <gmock/gmock.h>

#include <random>

#include "nn/safetensors_bytes.h"
#include "plumb/features/clip_segment.h"
#include "plumb/features/detector_factory.h"
#include "plumb/nn/layer_plan.h"
#include "plumb/nn/reference/layer_reference.h"
#include "support/gpu_fixture.h"
#include "support/temporary_directory.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kInputWidth = 128, kInputHeight = 64;

nn::Model TinyModel() {
  nn::ModelSpec spec;
  spec.preset = "custom";
  spec.width = 4;
  spec.input_width = kInputWidth;
  spec.input_height = kInputHeight;
  return nn::RandomModel(spec, 1);
}

const std::vector<std::byte>& TinyModelBytes() {
  static const std::vector<std::byte> bytes = [] {
    const nn::Model model = TinyModel();
    nn::Metadata metadata = nn::MetadataOf(model.spec);
    metadata["duplicate_decay"] = "0.9";
    metadata["duplicate_distance"] = "1000";  // The tiny network's lines are long and far apart.
    return nn::ModelBytes(model, metadata);
  }();
  return bytes;
}

// A picture with structure, so that neighbouring cells differ.
struct Picture {
  Picture(PixelFormat format, int width, int height) {
    const size_t rows = static_cast<size_t>(height) * (format == PixelFormat::kNv12 ? 3 : 2) / 2;
    const int row_bytes = width * (format == PixelFormat::kRgb8 ? 3 : 1);
    std::mt19937 random(5);
    pixels.resize(static_cast<size_t>(row_bytes) * rows);
    for (uint8_t& byte : pixels) byte = static_cast<uint8_t>(random());
    view.format = format;
    view.width_px = width;
    view.height_px = height;
    view.planes[0] = {pixels.data(), row_bytes};
    view.planes[1] = {pixels.data() + row_bytes * height, row_bytes};
  }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;
  ImageView view;
  std::vector<uint8_t> pixels;
};

class VlseDetectorTest : public testing::GpuTest {
 protected:
  // One detector for all tests: some drivers take seconds to compile a network.
  void SetUp() override {
    GpuTest::SetUp();
    if (IsSkipped() || HasFatalFailure() || detector_ != nullptr) return;
    VlseDetectorOptions options;
    options.model_data = TinyModelBytes();
    options.device = device_;
    options.score_threshold = 0.05f;
    options.max_lines = 200;
    Result<std::unique_ptr<VlseDetector>> detector = VlseDetector::Create(options);
    PLUMB_ASSERT_OK(detector);
    detector_ = std::move(*detector);
  }
  static void TearDownTestSuite() {
    detector_.reset();
    GpuTest::TearDownTestSuite();
  }

  std::vector<Segment2> Detect(const ImageView& image) {
    Result<std::vector<Segment2>> segments = detector_->Detect(image);
    PLUMB_EXPECT_OK(segments);
    return segments ? std::move(*segments) : std::vector<Segment2>();
  }

  void ExpectCreateFails(const VlseDetectorOptions& options, ErrorCode code,
                         const std::string& part) {
    const auto detector = VlseDetector::Create(options);
    ASSERT_FALSE(detector);
    EXPECT_EQ(detector.error().code, code);
    EXPECT_THAT(detector.error().message, HasSubstr(part));
  }

  static inline std::unique_ptr<VlseDetector> detector_;
};

void ExpectSame(const std::vector<Segment2>& a, const std::vector<Segment2>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].start, b[i].start) << i;
    EXPECT_EQ(a[i].end, b[i].end) << i;
    EXPECT_EQ(a[i].score, b[i].score) << i;
  }
}

TEST_F(VlseDetectorTest, AgreesWithTheCpuTwins) {
  Result<nn::Model> model = nn::ParseModel(TinyModelBytes());
  PLUMB_ASSERT_OK(model);
  const Picture picture(PixelFormat::kRgb8, 100, 70);
  const std::vector<float> tensor = ImageToTensorReference(picture.view, kInputWidth, kInputHeight,
                                                           {model->spec.mean, model->spec.std});
  const std::vector<float> planes =
      nn::reference::RunPlan(nn::BuildLayerPlan(*model, kInputWidth, kInputHeight), tensor);
  std::vector<DecodedLine> lines =
      DecodeLinesReference(planes,
                           {.width_cells = kInputWidth / 4,
                            .height_cells = kInputHeight / 4,
                            .max_lines = 200,
                            .score_threshold = 0.05f,
                            .nms_decay = model->spec.nms_decay,
                            .displacement_scale = model->spec.displacement_scale},
                           100, 70);
  const float score_of_last = lines.back().score;
  DecayDuplicates({model->spec.duplicate_distance, model->spec.duplicate_decay},
                  kInputWidth / 400.f, kInputHeight / 280.f, 0.05f, &lines);
  ASSERT_LT(lines.back().score, score_of_last) << "The picture has no duplicates to test with.";
  std::vector<Segment2> expected;
  for (const DecodedLine& line : lines) {
    Segment2 segment;
    segment.start = Eigen::Vector2d(line.start_x, line.start_y);
    segment.end = Eigen::Vector2d(line.end_x, line.end_y);
    segment.score = line.score;
    if (ClipToImage(100, 70, &segment)) expected.push_back(segment);
  }
  ASSERT_GT(expected.size(), 20u);

  const std::vector<Segment2> actual = Detect(picture.view);
  ASSERT_NEAR(static_cast<double>(actual.size()), static_cast<double>(expected.size()), 2.0);
  // Rounding may swap neighbours in the order and change who is last.
  size_t num_found = 0;
  for (const Segment2& e : expected) {
    for (const Segment2& a : actual) {
      if ((a.start - e.start).norm() < 0.05 && (a.end - e.end).norm() < 0.05 &&
          std::abs(a.score - e.score) < 1e-3) {
        ++num_found;
        break;
      }
    }
  }
  EXPECT_GE(num_found + 2, expected.size());
  for (size_t i = 1; i < actual.size(); ++i) EXPECT_GE(actual[i - 1].score, actual[i].score);
}

TEST_F(VlseDetectorTest, FollowsChangesOfSizeAndFormatAndComesBackToTheSameResult) {
  const Picture rgb(PixelFormat::kRgb8, 100, 70), nv12(PixelFormat::kNv12, 64, 48),
      gray(PixelFormat::kGray8, 33, 65);
  const std::vector<Segment2> first = Detect(rgb.view);
  EXPECT_FALSE(first.empty());
  ExpectSame(Detect(rgb.view), first);
  for (const Picture* other : {&nv12, &gray}) {
    for (const Segment2& segment : Detect(other->view)) {
      for (const Eigen::Vector2d& end : {segment.start, segment.end}) {
        EXPECT_GE(end.minCoeff(), -0.5 - 1e-9);
        EXPECT_LE(end.x(), other->view.width_px - 0.5 + 1e-9);
        EXPECT_LE(end.y(), other->view.height_px - 0.5 + 1e-9);
      }
    }
  }
  ExpectSame(Detect(rgb.view), first);
}

TEST_F(VlseDetectorTest, StageTimesAreNamed) {
  if (device_->Info().timestamp_period_ns == 0.0) GTEST_SKIP() << "no timestamps";
  Detect(Picture(PixelFormat::kRgb8, 100, 70).view);
  std::vector<std::string> names;
  for (const gpu::StageTime& stage : detector_->StageTimes()) {
    names.push_back(stage.name);
    EXPECT_GT(stage.duration_ns, 0) << stage.name;
  }
  EXPECT_THAT(names, ElementsAre("preprocess", "network", "decode"));
}

TEST_F(VlseDetectorTest, OneImageAtATime) {
  EXPECT_FALSE(detector_->Collect());
  const Picture picture(PixelFormat::kRgb8, 100, 70);
  PLUMB_ASSERT_OK(detector_->Submit(picture.view));
  const Status again = detector_->Submit(picture.view);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::kInvalidArgument);
  PLUMB_EXPECT_OK(detector_->Collect());
  EXPECT_FALSE(detector_->Collect());
}

TEST_F(VlseDetectorTest, TheImageMayChangeOnceItIsSubmitted) {
  Picture picture(PixelFormat::kRgb8, 100, 70);
  const std::vector<Segment2> expected = Detect(picture.view);
  PLUMB_ASSERT_OK(detector_->Submit(picture.view));
  std::fill(picture.pixels.begin(), picture.pixels.end(), uint8_t{0});
  Result<std::vector<Segment2>> segments = detector_->Collect();
  PLUMB_ASSERT_OK(segments);
  ExpectSame(*segments, expected);
}

TEST_F(VlseDetectorTest, ABadImageIsRefusedAndTheNextOneWorks) {
  ImageView nothing;
  EXPECT_FALSE(detector_->Submit(nothing));
  EXPECT_FALSE(Detect(Picture(PixelFormat::kRgb8, 100, 70).view).empty());
}

TEST_F(VlseDetectorTest, TheModelMustBeGivenExactlyOnce) {
  VlseDetectorOptions options;
  options.device = device_;
  ExpectCreateFails(options, ErrorCode::kInvalidArgument, "model_path or model_data");
  options.model_data = TinyModelBytes();
  options.model_path = "nano.safetensors";
  ExpectCreateFails(options, ErrorCode::kInvalidArgument, "model_path or model_data");
}

TEST_F(VlseDetectorTest, OptionsOutOfRangeAreNamed) {
  VlseDetectorOptions options;
  options.device = device_;
  options.model_data = TinyModelBytes();
  options.input_width_px = 100;
  ExpectCreateFails(options, ErrorCode::kInvalidArgument, "100");
  options.input_width_px = 0;
  options.max_lines = 0;
  ExpectCreateFails(options, ErrorCode::kInvalidArgument, "max_lines 0");
}

TEST_F(VlseDetectorTest, BrokenWeightsAreRefused) {
  VlseDetectorOptions options;
  options.device = device_;
  options.model_data = std::span(TinyModelBytes()).first(TinyModelBytes().size() - 1);
  const auto detector = VlseDetector::Create(options);
  ASSERT_FALSE(detector);
  EXPECT_EQ(detector.error().code, ErrorCode::kCorruptData);
}

TEST_F(VlseDetectorTest, TheFactoryFindsAModelByPathAndByName) {
  const testing::TemporaryDirectory folder;
  const std::vector<std::byte>& bytes = TinyModelBytes();
  testing::Spill(folder / "tiny.safetensors",
                 std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  VlseDetectorOptions options;
  options.device = device_;
  options.warm_up = false;
  auto by_name = CreateLineDetector("tiny", options, {folder / "none", folder.path()});
  PLUMB_ASSERT_OK(by_name);
  EXPECT_EQ((*by_name)->Name(), "custom");
  PLUMB_EXPECT_OK(CreateLineDetector(folder / "tiny.safetensors", options));
}

TEST(CreateLineDetector, LsdNeedsNoDevice) {
  auto detector = CreateLineDetector("lsd", {.device_options = {.selector = "no such device"}});
  ASSERT_TRUE(detector);
  EXPECT_EQ((*detector)->Name(), "lsd");
}

TEST(CreateLineDetector, AnUnknownNameIsReportedWithTheFolders) {
  const auto detector = CreateLineDetector("nono", {}, {"/models/here", "/models/there"});
  ASSERT_FALSE(detector);
  EXPECT_EQ(detector.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(detector.error().message, HasSubstr("'nono'"));
  EXPECT_THAT(detector.error().message, HasSubstr("/models/here, /models/there"));
}

TEST(CreateLineDetector, AMissingFileIsReportedWithItsPath) {
  const auto detector = CreateLineDetector("/no/such/file.safetensors", {});
  ASSERT_FALSE(detector);
  EXPECT_EQ(detector.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(detector.error().message, HasSubstr("/no/such/file.safetensors"));
}

TEST(CreateLineDetector, AnEmptyNameIsInvalid) {
  const auto detector = CreateLineDetector("", {});
  ASSERT_FALSE(detector);
  EXPECT_EQ(detector.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace plumb
