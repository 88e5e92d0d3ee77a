// The decoding kernels against their CPU twin, and the twin against what can be said by hand.
#include "plumb/features/vlse_decoder.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "support/gpu_fixture.h"

namespace plumb {
namespace {

using ::testing::HasSubstr;

constexpr int kImageWidth = 640, kImageHeight = 480;

std::vector<float> RandomPlanes(int width, int height, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0f, 2.0f);
  std::vector<float> planes(static_cast<size_t>(6 * width * height));
  for (float& v : planes) v = normal(random);
  return planes;
}

// Planes in which no cell is a line.
struct Canvas {
  Canvas(int width, int height)
      : width_cells(width), planes(static_cast<size_t>(6 * width * height), 0.0f) {
    for (size_t i = 0; i < Size(); ++i) planes[i] = 20.0f;
  }
  size_t Size() const { return planes.size() / 6; }
  // A line with its midpoint in this cell; `margin` is the logit of its score.
  void Draw(int x, int y, float margin, float dx, float dy) {
    const auto cell = static_cast<size_t>(y * width_cells + x);
    planes[cell] = 0.0f;
    planes[Size() + cell] = margin;
    planes[4 * Size() + cell] = dx;
    planes[5 * Size() + cell] = dy;
  }
  int width_cells;
  std::vector<float> planes;
};

class VlseDecoderTest : public testing::GpuTest,
                        public ::testing::WithParamInterface<nn::KernelFamily> {
 protected:
  void SetUp() override {
    GpuTest::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    if (GetParam() == nn::KernelFamily::kCpuSimd && !device_->Info().features.shader_int64) {
      GTEST_SKIP() << "no 64-bit stores";
    }
  }

  std::vector<DecodedLine> Decode(const std::vector<float>& planes, const DecodeOptions& options) {
    Result<std::unique_ptr<VlseDecoder>> decoder =
        VlseDecoder::Create(device_, options, GetParam());
    PLUMB_EXPECT_OK(decoder);
    if (!decoder) return {};
    const auto buffer = MakeBuffer(planes);
    auto recorder = gpu::Recorder::Create(device_);
    (*decoder)->Record(**recorder, buffer->All(), kImageWidth, kImageHeight);
    auto commands = (*recorder)->Finish();
    PLUMB_EXPECT_OK(commands);
    if (!commands) return {};
    PLUMB_EXPECT_OK((*commands)->Run());
    const auto first = (*decoder)->Lines();
    const std::vector<DecodedLine> lines(first.begin(), first.end());
    // The second run finds the first one's leftovers in memory and must not care.
    PLUMB_EXPECT_OK((*commands)->Run());
    const auto second = (*decoder)->Lines();
    EXPECT_EQ(second.size(), lines.size());
    EXPECT_EQ(std::memcmp(second.data(), lines.data(), lines.size() * sizeof(DecodedLine)), 0);
    return lines;
  }

  // The same lines up to rounding; where scores differ by rounding alone the order may differ, and
  // at the cut so may the choice.
  void ExpectMatchesReference(const std::vector<float>& planes, const DecodeOptions& options) {
    const std::vector<DecodedLine> expected =
        DecodeLinesReference(planes, options, kImageWidth, kImageHeight);
    const std::vector<DecodedLine> actual = Decode(planes, options);
    ASSERT_EQ(actual.size(), expected.size());
    std::map<uint32_t, DecodedLine> by_cell;
    for (const DecodedLine& line : expected) by_cell[line.cell] = line;
    size_t num_unmatched = 0;
    for (size_t i = 0; i < actual.size(); ++i) {
      EXPECT_NEAR(actual[i].score, expected[i].score, 1e-5) << "place " << i;
      if (i > 0) {
        EXPECT_LE(actual[i].score, actual[i - 1].score) << "place " << i;
      }
      const auto found = by_cell.find(actual[i].cell);
      if (found == by_cell.end()) {
        ++num_unmatched;
        EXPECT_NEAR(actual[i].score, expected.back().score, 1e-5);
        continue;
      }
      const DecodedLine& line = found->second;
      EXPECT_NEAR(actual[i].start_x, line.start_x, 1e-4 * kImageWidth);
      EXPECT_NEAR(actual[i].start_y, line.start_y, 1e-4 * kImageHeight);
      EXPECT_NEAR(actual[i].end_x, line.end_x, 1e-4 * kImageWidth);
      EXPECT_NEAR(actual[i].end_y, line.end_y, 1e-4 * kImageHeight);
    }
    EXPECT_LE(num_unmatched, 1u);
  }
};

INSTANTIATE_TEST_SUITE_P(Families, VlseDecoderTest,
                         ::testing::Values(nn::KernelFamily::kCpuSimd, nn::KernelFamily::kGpu));

TEST_P(VlseDecoderTest, MatchesReferenceOnRandomPlanes) {
  // One row; odd; the sizes of 320 x 320 and 512 x 512 inputs; with and without a cut at max_lines.
  const DecodeOptions cases[] = {{.width_cells = 4, .height_cells = 1, .max_lines = 10},
                                 {.width_cells = 12, .height_cells = 7, .max_lines = 1000},
                                 {.width_cells = 16, .height_cells = 33, .max_lines = 5},
                                 {.width_cells = 80, .height_cells = 80, .max_lines = 300},
                                 {.width_cells = 128, .height_cells = 128, .max_lines = 1000}};
  for (DecodeOptions options : cases) {
    for (const float threshold : {0.0f, 0.3f, 0.95f}) {
      options.score_threshold = threshold;
      ExpectMatchesReference(RandomPlanes(options.width_cells, options.height_cells, 7), options);
    }
  }
}

TEST_P(VlseDecoderTest, DisplacementScaleAndDecayAreUsed) {
  const DecodeOptions options{.width_cells = 16,
                              .height_cells = 16,
                              .max_lines = 300,
                              .score_threshold = 0.1f,
                              .nms_decay = 0.3f,
                              .displacement_scale = 5.0f};
  ExpectMatchesReference(RandomPlanes(16, 16, 3), options);
}

TEST_P(VlseDecoderTest, NoCandidateGivesNoLine) {
  EXPECT_TRUE(Decode(Canvas(16, 16).planes, {.width_cells = 16, .height_cells = 16}).empty());
}

TEST_P(VlseDecoderTest, ALineIsWhereItWasDrawn) {
  Canvas canvas(80, 80);
  canvas.Draw(10, 20, 3.0f, 4.0f, -2.0f);
  const auto lines = Decode(canvas.planes, {.width_cells = 80, .height_cells = 80});
  ASSERT_EQ(lines.size(), 1u);
  // Cell (10, 20), offset sigmoid(0) = 0.5; a cell is 8 x 6 px of the image.
  EXPECT_NEAR(lines[0].start_x, 8 * (10.5 - 4) - 0.5, 1e-3);
  EXPECT_NEAR(lines[0].start_y, 6 * (20.5 + 2) - 0.5, 1e-3);
  EXPECT_NEAR(lines[0].end_x, 8 * (10.5 + 4) - 0.5, 1e-3);
  EXPECT_NEAR(lines[0].end_y, 6 * (20.5 - 2) - 0.5, 1e-3);
  EXPECT_NEAR(lines[0].score, 1.0 / (1.0 + std::exp(-3.0)), 1e-5);
  EXPECT_EQ(lines[0].cell, 20u * 80u + 10u);
}

TEST_P(VlseDecoderTest, TheEndWithTheSmallerXComesFirst) {
  Canvas canvas(16, 16);
  canvas.Draw(3, 3, 3.0f, -2.0f, 1.0f);
  canvas.Draw(9, 9, 2.0f, 0.0f, -1.0f);
  const auto lines = Decode(canvas.planes, {.width_cells = 16, .height_cells = 16});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_LT(lines[0].start_x, lines[0].end_x);
  EXPECT_GT(lines[0].start_y, lines[0].end_y);
  EXPECT_LT(lines[1].start_y, lines[1].end_y);
}

TEST_P(VlseDecoderTest, ANeighbourOfAMaximumKeepsADecayedScore) {
  Canvas canvas(16, 16);
  for (const int x : {0, 5, 15}) {  // Both borders and the middle of a texel.
    canvas.Draw(x, x, 2.0f, 1.0f, 0.0f);
    canvas.Draw(x == 15 ? 14 : x + 1, x, 1.5f, 1.0f, 0.0f);
  }
  const auto lines = Decode(canvas.planes, {.width_cells = 16, .height_cells = 16});
  ASSERT_EQ(lines.size(), 6u);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(lines[i].score, 1 / (1 + std::exp(-2.0)), 1e-5);
  for (size_t i = 3; i < 6; ++i) EXPECT_NEAR(lines[i].score, 0.8 / (1 + std::exp(-1.5)), 1e-5);
}

TEST_P(VlseDecoderTest, OfEqualScoresTheFirstCellsWinInOrder) {
  const std::vector<float> planes(6 * 16 * 16, 0.0f);  // Every cell scores 0.5.
  const auto lines = Decode(planes, {.width_cells = 16, .height_cells = 16, .max_lines = 37});
  ASSERT_EQ(lines.size(), 37u);
  for (uint32_t i = 0; i < 37; ++i) EXPECT_EQ(lines[i].cell, i);
}

TEST_P(VlseDecoderTest, TiesAtTheCutDoNotDisplaceBetterCells) {
  Canvas canvas(64, 64);
  for (int i = 0; i < 21; ++i) canvas.Draw(3 * i, 1 + 3 * (i % 7), 1.0f, 1.0f, 0.0f);
  canvas.Draw(60, 60, 2.0f, 1.0f, 0.0f);
  const auto lines =
      Decode(canvas.planes, {.width_cells = 64, .height_cells = 64, .max_lines = 10});
  ASSERT_EQ(lines.size(), 10u);
  EXPECT_EQ(lines[0].cell, 60u * 64u + 60u);
  for (size_t i = 2; i < 10; ++i) EXPECT_LT(lines[i - 1].cell, lines[i].cell);
}

TEST_P(VlseDecoderTest, SaturatedScoresAreOrderedAndNanIsNoLine) {
  Canvas canvas(16, 16);
  canvas.Draw(2, 2, 200.0f, 1.0f, 0.0f);
  canvas.Draw(8, 2, 100.0f, 1.0f, 0.0f);
  canvas.Draw(12, 12, std::numeric_limits<float>::quiet_NaN(), 1.0f, 0.0f);
  const auto lines = Decode(canvas.planes, {.width_cells = 16, .height_cells = 16, .max_lines = 1});
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].score, 1.0f);
  EXPECT_EQ(lines[0].cell, 2u * 16u + 2u);
}

TEST_P(VlseDecoderTest, OptionsOutOfRangeAreNamed) {
  const std::pair<DecodeOptions, const char*> cases[] = {
      {{.width_cells = 6, .height_cells = 8}, "width_cells 6"},
      {{.width_cells = 8, .height_cells = 0}, "height_cells 0"},
      {{.width_cells = 8, .height_cells = 8, .max_lines = 0}, "max_lines 0"},
      {{.width_cells = 8, .height_cells = 8, .max_lines = 10, .score_threshold = NAN},
       "score_threshold"},
      {{.width_cells = 8,
        .height_cells = 8,
        .max_lines = 10,
        .score_threshold = 0.1f,
        .nms_decay = 1.5f},
       "nms_decay 1.5"}};
  for (const auto& [options, part] : cases) {
    const auto decoder = VlseDecoder::Create(device_, options, GetParam());
    ASSERT_FALSE(decoder) << part;
    EXPECT_EQ(decoder.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(decoder.error().message, HasSubstr(part));
  }
}

}  // namespace
}  // namespace plumb
