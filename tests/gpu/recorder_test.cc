// Dispatches, barriers, stage times and resubmission on the real device.
#include "plumb/gpu/recorder.h"

#include <numeric>

#include "shaders/registry.h"
#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

struct AxpyPush {
  uint32_t n;
  float scale;
};

class RecorderTest : public plumb::testing::GpuTest {
 protected:
  // out = scale * in + offset
  std::unique_ptr<Kernel> MakeAxpy(float offset) {
    Result<std::unique_ptr<Kernel>> kernel = Kernel::Create(
        device_, {.name = "axpy",
                  .spirv = shaders::Find("test/axpy"),
                  .bindings = {{0, BindingKind::kStorage, Access::kRead},
                               {1, BindingKind::kStorage, Access::kWrite}},
                  .push_constant_bytes = sizeof(AxpyPush),
                  .spec_constants = {SpecConstant::Uint(0, 8), SpecConstant::Float(1, offset)}});
    PLUMB_EXPECT_OK(kernel);
    return kernel ? std::move(*kernel) : nullptr;
  }

  std::unique_ptr<Recorder> MakeRecorder() {
    Result<std::unique_ptr<Recorder>> recorder = Recorder::Create(device_, {.name = "test"});
    PLUMB_EXPECT_OK(recorder);
    return recorder ? std::move(*recorder) : nullptr;
  }
};

std::vector<float> Ramp(size_t n) {
  std::vector<float> values(n);
  std::iota(values.begin(), values.end(), 0.0f);
  return values;
}

TEST_F(RecorderTest, DispatchComputesEveryElement) {
  const std::unique_ptr<Kernel> axpy = MakeAxpy(0.5f);
  const auto in = MakeBuffer(Ramp(13)), out = MakeBuffer(std::vector<float>(13));
  const auto recorder = MakeRecorder();
  recorder->Dispatch(*axpy, {in->All(), out->All()}, AxpyPush{13, 2.0f}, {2});
  auto commands = recorder->Finish();
  PLUMB_ASSERT_OK(commands);
  PLUMB_ASSERT_OK((*commands)->Run());
  const std::vector<float> values = Read<float>(out->All());
  for (size_t i = 0; i < 13; ++i) EXPECT_EQ(values[i], 2.0f * static_cast<float>(i) + 0.5f);
}

}  // namespace
}  // namespace plumb::gpu
