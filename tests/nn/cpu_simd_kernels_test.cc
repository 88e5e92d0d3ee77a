// Every kernel of the family cpu-simd against its CPU twin, on shapes that do not fit its blocks.
#include <gtest/gtest.h>

#include "nn/plan_runner.h"
#include "plumb/nn/ops/cpu_simd.h"

namespace plumb::nn {
namespace {

constexpr double kTolerance = 1e-4;

class CpuSimdKernels : public PlanTest {
 protected:
  void SetUp() override {
    PlanTest::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    const std::string missing = MissingForCpuSimd(device_->Info());
    if (!missing.empty()) GTEST_SKIP() << missing;
  }

  void Check(const LayerPlan& plan, const CpuSimdOptions& options = {}) {
    const auto features = RandomInputs(plan);
    const int output = plan.layers.back().output;
    const auto expected = reference::RunLayer(plan, plan.layers.back(), features);
    std::vector<std::vector<float>> inputs(features.size());
    for (size_t i = 0; i < features.size(); ++i) {
      if (features[i].empty()) continue;
      inputs[i] = static_cast<int>(i) == plan.input ? features[i]
                                                    : PlanarToP8(plan.features[i], features[i]);
    }
    const auto raw = Run(PlanCpuSimd(plan, options), inputs, output);
    const Feature& shape = plan.features[output];
    if (output == plan.output) {
      EXPECT_LT(RelativeError(raw, expected), kTolerance);
      return;
    }
    EXPECT_LT(RelativeError(P8ToPlanar(shape, raw), expected), kTolerance);
    // Padding columns must be zero: the next layer's taps read them.
    const auto clean = PlanarToP8(shape, P8ToPlanar(shape, raw));
    const size_t row_blocks = (shape.width + 7) / 8;
    const size_t written = shape.height * row_blocks * shape.channels * 8;
    EXPECT_TRUE(std::equal(raw.begin(), raw.begin() + written, clean.begin()));
  }

  void Check(const LayerCase& c) { Check(MakeLayerPlan(c)); }
};

TEST_F(CpuSimdKernels, PointwiseOnOddShapes) {
  Check({.taps = Taps::k1x1, .in = 32, .out = 32, .height = 5, .width = 5});
  Check({.taps = Taps::k1x1, .in = 12, .out = 20, .height = 3, .width = 17});
  Check({.taps = Taps::k1x1, .in = 64, .out = 6, .height = 10, .width = 24});
}

TEST_F(CpuSimdKernels, PointwiseWithPrologueAndRelu) {
  Check({.in = 64, .out = 32, .height = 7, .width = 20, .prologue = true, .relu = true});
  Check({.in = 20, .out = 8, .height = 4, .width = 9, .prologue = true});
}

TEST_F(CpuSimdKernels, PointwiseWithResidualAndUpsampling) {
  Check({.in = 32, .out = 64, .height = 6, .width = 20, .residual = true});
  Check({.in = 16, .out = 32, .height = 10, .width = 10, .residual = true, .upsampled = true});
  Check({.in = 16, .out = 32, .height = 4, .width = 40, .upsampled = true});
}

TEST_F(CpuSimdKernels, PointwiseOverTwoInputs) {
  Check({.in = 16, .out = 32, .height = 6, .width = 8, .extra = 16});
  Check({.in = 32,
         .out = 16,
         .height = 5,
         .width = 11,
         .extra = 6,
         .prologue = true,
         .residual = true});
}

TEST_F(CpuSimdKernels, PointwiseSplitIntoPartialSums) {
  Check({.in = 160, .out = 32, .height = 6, .width = 8, .prologue = true, .relu = true});
  Check({.in = 200,
         .out = 16,
         .height = 6,
         .width = 12,
         .extra = 150,
         .residual = true,
         .upsampled = true});
}

TEST_F(CpuSimdKernels, PlanarOutput) {
  Check({.in = 48, .out = 6, .height = 16, .width = 24, .planar_output = true});
}

TEST_F(CpuSimdKernels, SquareDirectly) {
  const CpuSimdOptions direct{.winograd = false};
  Check(MakeLayerPlan({.taps = Taps::k3x3, .in = 16, .out = 16, .height = 5, .width = 5}), direct);
  Check(MakeLayerPlan(
            {.taps = Taps::k3x3, .in = 32, .out = 48, .height = 9, .width = 24, .relu = true}),
        direct);
  Check(MakeLayerPlan(
            {.taps = Taps::k3x3, .in = 80, .out = 8, .height = 6, .width = 12, .relu = true}),
        direct);
}

TEST_F(CpuSimdKernels, SquareByWinogradOnOddShapes) {
  Check({.taps = Taps::k3x3, .in = 16, .out = 16, .height = 5, .width = 5});
  Check({.taps = Taps::k3x3, .in = 32, .out = 48, .height = 9, .width = 24, .relu = true});
  Check({.taps = Taps::k3x3, .in = 4, .out = 8, .height = 1, .width = 33});
}

TEST_F(CpuSimdKernels, SquareByWinogradSplitIntoPartialSums) {
  Check({.taps = Taps::k3x3, .in = 80, .out = 8, .height = 6, .width = 12, .relu = true});
}

TEST_F(CpuSimdKernels, CrossOnOddShapes) {
  Check({.taps = Taps::kCross7, .in = 32, .out = 32, .height = 5, .width = 5, .relu = true});
  Check({.taps = Taps::kCross7, .in = 16, .out = 8, .height = 20, .width = 20});
  Check({.taps = Taps::kCross7, .in = 8, .out = 8, .height = 2, .width = 31});
}

TEST_F(CpuSimdKernels, CrossSplitIntoPartialSums) {
  Check({.taps = Taps::kCross7, .in = 40, .out = 8, .height = 6, .width = 12, .relu = true});
}

TEST_F(CpuSimdKernels, Stem) {
  Check({.taps = Taps::k7x7S2, .in = 3, .out = 16, .height = 32, .width = 32, .relu = true});
  Check({.taps = Taps::k7x7S2, .in = 3, .out = 4, .height = 5, .width = 40, .relu = true});
}

TEST_F(CpuSimdKernels, WeightsByAddress) {
  const auto& features = device_->Info().features;
  if (!features.buffer_device_address || !features.shader_int64) GTEST_SKIP() << "no addresses";
  for (const Taps taps : {Taps::k1x1, Taps::k3x3, Taps::kCross7}) {
    Check(
        MakeLayerPlan({.taps = taps, .in = 20, .out = 16, .height = 5, .width = 12, .relu = true}),
        {.weights = WeightSource::kAddress});
  }
}

TEST_F(CpuSimdKernels, MaxPooling) {
  for (const auto& [height, width] : {std::pair(5, 5), std::pair(10, 20), std::pair(3, 12)}) {
    LayerPlan plan;
    plan.input = plan.output = -1;
    plan.features = {{24, 2 * height, 2 * width}, {24, height, width}};
    plan.layers.resize(1);
    plan.layers[0].kind = LayerKind::kMaxPool2;
    plan.layers[0].input = 0;
    plan.layers[0].output = 1;
    Check(plan);
  }
}

TEST(CpuSimdLayout, ConversionsAreInverse) {
  const Feature shape{3, 5, 13};
  const auto planar = RandomValues(PlanarSize(shape), 1);
  EXPECT_EQ(P8ToPlanar(shape, PlanarToP8(shape, planar)), planar);
  EXPECT_EQ(P8Size(shape), 16u * 3u * 8u);  // 8 rows of 2 blocks: whole groups.
}

TEST(CpuSimdOptions, FollowTheDriverVersion) {
  gpu::DeviceInfo device;
  device.features.buffer_device_address = device.features.shader_int64 = true;
  device.driver_info = "Mesa 22.3.6 (LLVM 15.0.6)";
  EXPECT_EQ(ChooseCpuSimdOptions(device).weights, WeightSource::kTexels);
  device.driver_info = "Mesa 25.0.7-2 (LLVM 19.1.7)";
  EXPECT_EQ(ChooseCpuSimdOptions(device).weights, WeightSource::kAddress);
  device.features.shader_int64 = false;
  EXPECT_EQ(ChooseCpuSimdOptions(device).weights, WeightSource::kTexels);
}

}  // namespace
}  // namespace plumb::nn
