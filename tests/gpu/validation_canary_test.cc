// Proves that the validation layer hears planted errors: the other tests rely on its silence.
#include <gmock/gmock.h>

#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"
#include "shaders/registry.h"
#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

struct AxpyPush {
  uint32_t n;
  float scale;
};

class ValidationCanaryTest : public plumb::testing::GpuTest {
 protected:
  void TearDown() override {
    if (device_ != nullptr) device_->ClearValidationMessages();  // They were planted.
    GpuTest::TearDown();
  }

  // A chain in -> middle -> out of two dispatches whose binding table declares `access` for the
  // binding that the shader writes.
  void RunChain(Access access) {
    auto kernel = Kernel::Create(device_, {.name = "canary",
                                           .spirv = shaders::Find("test/axpy"),
                                           .bindings = {{0, BindingKind::kStorage, Access::kRead},
                                                        {1, BindingKind::kStorage, access}},
                                           .push_constant_bytes = sizeof(AxpyPush),
                                           .spec_constants = {SpecConstant::Uint(0, 8)}});
    PLUMB_ASSERT_OK(kernel);
    const auto in = MakeBuffer(std::vector<float>(64)), middle = MakeBuffer(std::vector<float>(64)),
               out = MakeBuffer(std::vector<float>(64));
    auto recorder = Recorder::Create(device_);
    PLUMB_ASSERT_OK(recorder);
    (*recorder)->Dispatch(**kernel, {in->All(), middle->All()}, AxpyPush{64, 1.0f}, {8});
    (*recorder)->Dispatch(**kernel, {middle->All(), out->All()}, AxpyPush{64, 1.0f}, {8});
    auto commands = (*recorder)->Finish();
    PLUMB_ASSERT_OK(commands);
    PLUMB_ASSERT_OK((*commands)->Run());
  }
};

TEST_F(ValidationCanaryTest, AMissingBarrierIsReported) {
  RunChain(Access::kRead);  // A lie, so the recorder sees no conflict.
  EXPECT_THAT(device_->ValidationMessages(), Contains(HasSubstr("READ_AFTER_WRITE")));
}

TEST_F(ValidationCanaryTest, TheSameChainWithItsBarrierIsNot) {
  RunChain(Access::kWrite);
  EXPECT_THAT(device_->ValidationMessages(), IsEmpty());
}

TEST_F(ValidationCanaryTest, ABindingThatTheTableForgetsIsReported) {
  const auto kernel =
      Kernel::Create(device_, {.name = "canary",
                               .spirv = shaders::Find("test/axpy"),
                               .bindings = {{0, BindingKind::kStorage, Access::kRead}},
                               .push_constant_bytes = sizeof(AxpyPush),
                               .spec_constants = {SpecConstant::Uint(0, 8)}});
  EXPECT_THAT(device_->ValidationMessages(), Not(IsEmpty()));
}

}  // namespace
}  // namespace plumb::gpu
