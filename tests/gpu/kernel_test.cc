// Creation of kernels, and what a kernel may rely on.
#include "plumb/gpu/kernel.h"

#include <gmock/gmock.h>

#include "plumb/gpu/recorder.h"
#include "shaders/registry.h"
#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::HasSubstr;

class KernelTest : public plumb::testing::GpuTest {
 protected:
  void ExpectRefused(const KernelInfo& info, const std::string& part) {
    const Result<std::unique_ptr<Kernel>> kernel = Kernel::Create(device_, info);
    ASSERT_FALSE(kernel);
    EXPECT_THAT(kernel.error().message, HasSubstr(part));
  }

  KernelInfo Axpy() {
    return {.name = "axpy",
            .spirv = shaders::Find("test/axpy"),
            .bindings = {{0, BindingKind::kStorage, Access::kRead},
                         {1, BindingKind::kStorage, Access::kWrite}},
            .push_constant_bytes = 8,
            .spec_constants = {SpecConstant::Uint(0, 8)}};
  }
};

TEST_F(KernelTest, AnUnknownShaderIsRefusedByName) {
  KernelInfo info = Axpy();
  info.spirv = shaders::Find("no/such_shader");
  ExpectRefused(info, "kernel 'axpy': its code is not SPIR-V");
}

TEST_F(KernelTest, TooManyPushConstantsAreRefusedWithTheNumber) {
  KernelInfo info = Axpy();
  info.push_constant_bytes = 1 << 20;
  ExpectRefused(info, "1048576");
}

TEST_F(KernelTest, ABindingListedTwiceIsRefused) {
  KernelInfo info = Axpy();
  info.bindings[1].binding = 0;
  ExpectRefused(info, "binding 0 is listed twice");
}

TEST_F(KernelTest, AWritableTexelBufferIsRefused) {
  KernelInfo info = Axpy();
  info.bindings[1].kind = BindingKind::kTexelR32F;
  ExpectRefused(info, "cannot be written");
}

TEST(ShaderRegistry, FindsEveryNameAndNothingElse) {
  const std::vector<std::string_view> names = shaders::Names();
  EXPECT_FALSE(names.empty());
  for (const std::string_view name : names) {
    ASSERT_GE(shaders::Find(name).size(), 5u) << name;
    EXPECT_EQ(shaders::Find(name)[0], 0x07230203u) << name;
  }
  EXPECT_TRUE(shaders::Find("").empty());
}

// lavapipe before Mesa 25 lets the loops of one invocation go round 65 535 times in all, and says
// nothing. Every kernel here stays below 60 000; this shows that the budget is real and enough.
class LoopBudgetTest : public KernelTest {
 protected:
  uint32_t CountIterations(uint32_t outer, uint32_t inner) {
    auto kernel =
        Kernel::Create(device_, {.name = "loop_budget",
                                 .spirv = shaders::Find("test/loop_budget"),
                                 .bindings = {{0, BindingKind::kStorage, Access::kRead},
                                              {1, BindingKind::kStorage, Access::kWrite}}});
    PLUMB_EXPECT_OK(kernel);
    const auto limits = MakeBuffer(std::vector<uint32_t>{outer, inner});
    const auto out = MakeBuffer(std::vector<uint32_t>{0});
    auto recorder = Recorder::Create(device_);
    (*recorder)->Dispatch(**kernel, {limits->All(), out->All()}, Groups{1});
    auto commands = (*recorder)->Finish();
    PLUMB_EXPECT_OK(commands);
    PLUMB_EXPECT_OK((*commands)->Run());
    return Read<uint32_t>(out->All())[0];
  }
};

TEST_F(LoopBudgetTest, SixtyThousandIterationsRun) {
  EXPECT_EQ(CountIterations(200, 295), 200u * 295u);  // 59 200 with the outer loop's own.
}

TEST_F(LoopBudgetTest, OldLavapipeStopsBeyondIt) {
  const DeviceInfo& info = device_->Info();
  if (!info.IsLavapipe() || info.driver_info.find("Mesa 22.") == std::string::npos) {
    EXPECT_EQ(CountIterations(400, 400), 160000u);
  } else {
    EXPECT_LT(CountIterations(400, 400), 65536u);
  }
}

}  // namespace
}  // namespace plumb::gpu
