// Every kernel of the family gpu against its CPU twin, on shapes that do not fit its tiles.
#include <gtest/gtest.h>

#include "nn/plan_runner.h"
#include "plumb/nn/ops/gpu_tiles.h"

namespace plumb::nn {
namespace {

class GpuKernels : public PlanTest {
 protected:
  void Check(const LayerPlan& plan) {
    const auto features = RandomInputs(plan);
    const int output = plan.layers.back().output;
    const auto expected = reference::RunLayer(plan, plan.layers.back(), features);
    EXPECT_LT(RelativeError(Run(PlanGpuTiles(plan), features, output), expected), 1e-4);
  }

  void Check(const LayerCase& c) { Check(MakeLayerPlan(c)); }
};

TEST_F(GpuKernels, Pointwise) {
  Check({.in = 32, .out = 32, .height = 5, .width = 5});
  Check({.in = 13, .out = 6, .height = 9, .width = 17, .prologue = true, .relu = true});
  Check({.in = 20, .out = 70, .height = 8, .width = 10, .residual = true, .upsampled = true});
}

TEST_F(GpuKernels, PointwiseOverTwoInputs) {
  Check({.in = 16,
         .out = 32,
         .height = 6,
         .width = 9,
         .extra = 6,
         .prologue = true,
         .residual = true});
}

TEST_F(GpuKernels, Square) {
  Check({.taps = Taps::k3x3, .in = 16, .out = 16, .height = 5, .width = 5, .relu = true});
  Check({.taps = Taps::k3x3, .in = 5, .out = 40, .height = 9, .width = 13});
}

TEST_F(GpuKernels, Cross) {
  Check({.taps = Taps::kCross7, .in = 8, .out = 12, .height = 5, .width = 11, .relu = true});
}

TEST_F(GpuKernels, Stem) {
  Check({.taps = Taps::k7x7S2, .in = 3, .out = 16, .height = 9, .width = 16, .relu = true});
}

TEST_F(GpuKernels, MaxPooling) {
  LayerPlan plan;
  plan.input = plan.output = -1;
  plan.features = {{7, 10, 26}, {7, 5, 13}};
  plan.layers.resize(1);
  plan.layers[0].kind = LayerKind::kMaxPool2;
  plan.layers[0].input = 0;
  plan.layers[0].output = 1;
  Check(plan);
}

}  // namespace
}  // namespace plumb::nn
