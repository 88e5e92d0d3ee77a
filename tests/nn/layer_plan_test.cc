// The fused layer list computes what the unfused network computes.
#include "plumb/nn/layer_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "plumb/nn/reference/layer_reference.h"
#include "plumb/nn/reference/network_reference.h"
#include "plumb/nn/weight_folding.h"

namespace plumb::nn {
namespace {

ModelSpec Spec(int width, BlockKind block, int stacks) {
  ModelSpec spec;
  spec.width = width;
  spec.block = block;
  spec.stacks = stacks;
  return spec;
}

reference::Plane Image(int width, int height) {
  reference::Plane image(static_cast<size_t>(3) * width * height);
  uint32_t state = 7;
  for (float& value : image) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) * 0x1p-23f - 1.0f;
  }
  return image;
}

double RelativeError(const reference::Plane& a, const reference::Plane& b) {
  double difference = 0, size = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference = std::max(difference, std::abs(static_cast<double>(a[i]) - b[i]));
    size = std::max(size, std::abs(static_cast<double>(b[i])));
  }
  return difference / size;
}

void ExpectFusedEqualsUnfused(const ModelSpec& spec, int width, int height) {
  const Model model = RandomModel(spec, 3);
  const reference::Plane image = Image(width, height);
  const auto unfused = reference::RunUnfused(model, image, width, height);
  const auto fused = reference::RunPlan(BuildLayerPlan(model, width, height), image);
  ASSERT_EQ(fused.size(), unfused.size());
  EXPECT_EQ(fused.size(), static_cast<size_t>(6) * (width / 4) * (height / 4));
  EXPECT_LT(RelativeError(fused, unfused), 1e-5);
}

TEST(LayerPlan, FusedEqualsUnfusedWithBasicBlocks) {
  ExpectFusedEqualsUnfused(Spec(8, BlockKind::kBasic, 1), 64, 64);
}

TEST(LayerPlan, FusedEqualsUnfusedWithHybridBlocks) {
  ExpectFusedEqualsUnfused(Spec(8, BlockKind::kHybrid, 1), 64, 128);
}

TEST(LayerPlan, FusedEqualsUnfusedWithFeedbackBetweenStacks) {
  ExpectFusedEqualsUnfused(Spec(4, BlockKind::kHybrid, 2), 128, 64);
}

TEST(LayerPlan, CrossOffsetsAreTheUnionOfTheThreeKernels) {
  std::set<std::pair<int, int>> expected;
  for (int a = -3; a <= 3; ++a) {
    expected.insert({a, 0});
    expected.insert({0, a});
  }
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) expected.insert({y, x});
  }
  const auto taps = TapOffsets(Taps::kCross7);
  EXPECT_EQ(std::set(taps.begin(), taps.end()), expected);
  EXPECT_EQ(taps.size(), expected.size());
}

TEST(LayerPlan, EveryInputIsWrittenBeforeItIsRead) {
  const LayerPlan plan = BuildLayerPlan(RandomModel(Spec(4, BlockKind::kHybrid, 2), 1), 64, 64);
  std::set<int> written = {plan.input};
  for (const Layer& layer : plan.layers) {
    for (const int feature : {layer.input, layer.extra_input, layer.residual, layer.upsampled}) {
      if (feature >= 0) {
        EXPECT_TRUE(written.contains(feature)) << layer.name;
      }
    }
    EXPECT_TRUE(written.insert(layer.output).second) << layer.name << " writes twice";
  }
  EXPECT_TRUE(written.contains(plan.output));
}

TEST(LayerPlan, ShapesOfWeightsFollowTheFeatures) {
  const LayerPlan plan = BuildLayerPlan(RandomModel(Spec(16, BlockKind::kHybrid, 1), 1), 320, 320);
  for (const Layer& layer : plan.layers) {
    if (layer.kind != LayerKind::kConv) continue;
    int in = plan.features[layer.input].channels;
    if (layer.extra_input >= 0) in += plan.features[layer.extra_input].channels;
    const int out = plan.features[layer.output].channels;
    EXPECT_EQ(layer.bias.size(), static_cast<size_t>(out)) << layer.name;
    EXPECT_EQ(layer.weights.size(), TapOffsets(layer.taps).size() * in * out) << layer.name;
  }
}

TEST(LayerPlan, CountsTheMultiplyAddsOfTheLiterature) {
  // Standard width, one stack, 320 x 320: 10.9 GMAC with basic blocks; hybrid blocks collapsed.
  const auto gmac = [](BlockKind block) {
    return CountMacs(BuildLayerPlan(RandomModel(Spec(64, block, 1), 1), 320, 320)) * 1e-9;
  };
  EXPECT_NEAR(gmac(BlockKind::kBasic), 10.9, 0.1);
  EXPECT_NEAR(gmac(BlockKind::kHybrid), 34.2 * 320 * 320 / 512 / 512, 0.1);
}

TEST(LayerPlan, FoldingAppliesTheNormToWeightsAndBias) {
  FoldedConv conv;
  conv.out = 1;
  conv.taps = 1;
  conv.in = 2;
  conv.weights = {2, 3};
  conv.bias = {1};
  const FoldedConv folded = Fold(conv, {{10}, {5}});
  EXPECT_EQ(folded.weights, (std::vector<double>{20, 30}));
  EXPECT_EQ(folded.bias, (std::vector<double>{15}));
}

}  // namespace
}  // namespace plumb::nn
