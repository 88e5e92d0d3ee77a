// Dispatches, barriers, stage times and resubmission on the real device.
#include "plumb/gpu/recorder.h"

#include <gmock/gmock.h>

#include <numeric>

#include "shaders/registry.h"
#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

struct AxpyPush {
  uint32_t n;
  float scale;
};

class RecorderTest : public plumb::testing::GpuTest {
 protected:
  static constexpr uint32_t kSize = 5000;
  static constexpr uint32_t kGroups = (kSize + 7) / 8;

  void SetUp() override {
    GpuTest::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    // out = scale * in + 1
    axpy_ =
        MakeKernel({.name = "axpy",
                    .spirv = shaders::Find("test/axpy"),
                    .bindings = {{0, BindingKind::kStorage, Access::kRead},
                                 {1, BindingKind::kStorage, Access::kWrite}},
                    .push_constant_bytes = sizeof(AxpyPush),
                    .spec_constants = {SpecConstant::Uint(0, 8), SpecConstant::Float(1, 1.0f)}});
    recorder_ = MakeRecorder();
    ASSERT_TRUE(axpy_ != nullptr && recorder_ != nullptr);
  }

  std::unique_ptr<Kernel> MakeKernel(KernelInfo info) {
    Result<std::unique_ptr<Kernel>> kernel = Kernel::Create(device_, std::move(info));
    PLUMB_EXPECT_OK(kernel);
    return kernel ? std::move(*kernel) : nullptr;
  }

  std::unique_ptr<Recorder> MakeRecorder() {
    Result<std::unique_ptr<Recorder>> recorder = Recorder::Create(device_, {.name = "test"});
    PLUMB_EXPECT_OK(recorder);
    return recorder ? std::move(*recorder) : nullptr;
  }

  std::unique_ptr<Buffer> Constant(float value) {
    return MakeBuffer(std::vector<float>(kSize, value));
  }

  void Axpy(const Buffer& in, const Buffer& out, float scale = 1.0f) {
    recorder_->Dispatch(*axpy_, {in.All(), out.All()}, AxpyPush{kSize, scale}, {kGroups});
  }

  std::unique_ptr<CommandList> Finish() {
    Result<std::unique_ptr<CommandList>> commands = recorder_->Finish();
    PLUMB_EXPECT_OK(commands);
    return commands ? std::move(*commands) : nullptr;
  }

  void ExpectFinishFails(const std::string& part) {
    const Result<std::unique_ptr<CommandList>> commands = recorder_->Finish();
    ASSERT_FALSE(commands);
    EXPECT_EQ(commands.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(commands.error().message, HasSubstr(part));
  }

  std::unique_ptr<Kernel> axpy_;
  std::unique_ptr<Recorder> recorder_;
};

TEST_F(RecorderTest, DispatchComputesEveryElementWithItsConstants) {
  std::vector<float> ramp(13);
  std::iota(ramp.begin(), ramp.end(), 0.0f);
  const auto in = MakeBuffer(ramp), out = MakeBuffer(std::vector<float>(16, -1.0f));
  recorder_->Dispatch(*axpy_, {in->All(), out->All()}, AxpyPush{13, 2.0f}, {2});
  PLUMB_ASSERT_OK(Finish()->Run());
  const std::vector<float> values = Read<float>(out->All());
  for (size_t i = 0; i < 13; ++i) EXPECT_EQ(values[i], 2.0f * static_cast<float>(i) + 1.0f);
  for (size_t i = 13; i < 16; ++i) EXPECT_EQ(values[i], -1.0f);  // Beyond n nothing is written.
}

TEST_F(RecorderTest, AChainSeesEveryEarlierResult) {
  const auto a = Constant(0.0f), b = Constant(-1.0f);
  for (int i = 0; i < 10; ++i) {
    Axpy(*a, *b);
    Axpy(*b, *a);
  }
  EXPECT_EQ(recorder_->NumDispatches(), 20u);
  EXPECT_EQ(recorder_->NumBarriers(), 19u);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(a->All()), Each(20.0f));
}

TEST_F(RecorderTest, IndependentDispatchesGetNoBarrier) {
  const auto in = Constant(3.0f), a = Constant(0.0f), b = Constant(0.0f);
  Axpy(*in, *a);
  Axpy(*in, *b);
  EXPECT_EQ(recorder_->NumBarriers(), 0u);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(b->All()), Each(4.0f));
}

TEST_F(RecorderTest, SlicesOfOneBufferAreIndependentUnlessTheyOverlap) {
  const uint64_t part = device_->Info().limits.buffer_offset_alignment;
  const uint32_t n = static_cast<uint32_t>(part / sizeof(float));
  const auto buffer = MakeBuffer(std::vector<float>(4 * n, 1.0f));
  recorder_->Dispatch(*axpy_, {buffer->Slice(0, part), buffer->Slice(part, part)},
                      AxpyPush{n, 1.0f}, {n / 8});
  recorder_->Dispatch(*axpy_, {buffer->Slice(2 * part, part), buffer->Slice(3 * part, part)},
                      AxpyPush{n, 1.0f}, {n / 8});
  EXPECT_EQ(recorder_->NumBarriers(), 0u);
  recorder_->Dispatch(*axpy_, {buffer->Slice(part, part), buffer->Slice(0, part)},
                      AxpyPush{n, 1.0f}, {n / 8});
  EXPECT_EQ(recorder_->NumBarriers(), 1u);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(buffer->Slice(0, part)), Each(3.0f));
}

TEST_F(RecorderTest, AListRunsAgainOnWhatItLeftBehind) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  Axpy(*a, *b);
  Axpy(*b, *a);
  const auto commands = Finish();
  for (int run = 0; run < 50; ++run) PLUMB_ASSERT_OK(commands->Run());
  EXPECT_THAT(Read<float>(a->All()), Each(100.0f));
}

TEST_F(RecorderTest, HostSeesNewInputAndOutputOfEverySubmission) {
  const auto in = MakeBuffer(std::vector<float>(kSize), MemoryUse::kUpload);
  const auto out = MakeBuffer(std::vector<float>(kSize), MemoryUse::kReadback);
  Axpy(*in, *out);
  const auto commands = Finish();
  for (int run = 0; run < 5; ++run) {
    std::vector<float> values(kSize, static_cast<float>(run));
    std::memcpy(in->Data(), values.data(), kSize * sizeof(float));
    PLUMB_ASSERT_OK(commands->Run());
    EXPECT_EQ(reinterpret_cast<const float*>(out->Data())[kSize - 1], static_cast<float>(run + 1));
  }
}

TEST_F(RecorderTest, ASecondSubmitWhileInFlightIsRefusedAndWaitMayBeRepeated) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  Axpy(*a, *b);
  const auto commands = Finish();
  PLUMB_ASSERT_OK(commands->Submit());
  EXPECT_TRUE(commands->InFlight());
  const Status again = commands->Submit();
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::kInvalidArgument);
  Result<WaitResult> waited = WaitResult::kTimeout;
  while (waited && *waited == WaitResult::kTimeout) {
    waited = commands->Wait(std::chrono::milliseconds(1));
  }
  PLUMB_ASSERT_OK(waited);
  EXPECT_FALSE(commands->InFlight());
  waited = commands->Wait(std::chrono::seconds(0));
  PLUMB_ASSERT_OK(waited);
  EXPECT_EQ(*waited, WaitResult::kDone);
}

TEST_F(RecorderTest, StageTimesAreNamedAndGrowWithTheWork) {
  if (device_->Info().timestamp_period_ns == 0.0) GTEST_SKIP() << "no timestamps";
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->BeginStage("short");
  Axpy(*a, *b);
  recorder_->BeginStage("long");
  for (int i = 0; i < 100; ++i) {
    Axpy(*b, *a);
    Axpy(*a, *b);
  }
  const auto commands = Finish();
  PLUMB_ASSERT_OK(commands->Run());  // The first run compiles on some devices.
  PLUMB_ASSERT_OK(commands->Run());
  const std::vector<StageTime>& times = commands->StageTimes();
  ASSERT_EQ(times.size(), 2u);
  EXPECT_EQ(times[0].name, "short");
  EXPECT_EQ(times[1].name, "long");
  EXPECT_GE(times[0].duration_ns, 0);
  EXPECT_GT(times[1].duration_ns, times[0].duration_ns);
}

TEST_F(RecorderTest, CopyAndFillAreOrderedWithDispatches) {
  const auto a = Constant(0.0f), b = Constant(0.0f), c = Constant(0.0f);
  recorder_->Fill(a->All(), std::bit_cast<uint32_t>(41.0f));
  Axpy(*a, *b);
  recorder_->Copy(b->All(), c->All());
  recorder_->Fill(b->All(), 0);
  EXPECT_EQ(recorder_->NumBarriers(), 3u);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(c->All()), Each(42.0f));
  EXPECT_THAT(Read<float>(b->All()), Each(0.0f));
}

TEST_F(RecorderTest, TexelBuffersReadTheirSlice) {
  const auto copy = MakeKernel({.name = "texel_copy",
                                .spirv = shaders::Find("test/texel_copy"),
                                .bindings = {{0, BindingKind::kTexelRgba32F, Access::kRead},
                                             {1, BindingKind::kStorage, Access::kWrite}},
                                .push_constant_bytes = 4});
  const uint64_t offset = device_->Info().limits.buffer_offset_alignment;
  std::vector<float> values(offset / 4 + 40);
  std::iota(values.begin(), values.end(), 0.0f);
  const auto in = MakeBuffer(values), out = MakeBuffer(std::vector<float>(40));
  struct Push {
    uint32_t n;
  };
  recorder_->Dispatch(*copy, {in->Slice(offset, 160), out->All()}, Push{10}, {2});
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_EQ(Read<float>(out->All()),
            std::vector<float>(values.begin() + static_cast<ptrdiff_t>(offset / 4), values.end()));
}

TEST_F(RecorderTest, AccessesThroughAddressesGetBarriers) {
  if (!device_->Info().features.buffer_device_address) GTEST_SKIP() << "no buffer addresses";
  struct Push {
    uint64_t source, target;
    uint32_t n, padding;
  };
  const auto twice = MakeKernel({.name = "address_double",
                                 .spirv = shaders::Find("test/address_double"),
                                 .bindings = {},
                                 .push_constant_bytes = sizeof(Push)});
  const auto a = Constant(1.0f), b = Constant(0.0f);
  for (int i = 0; i < 5; ++i) {
    const Buffer &from = i % 2 == 0 ? *a : *b, &to = i % 2 == 0 ? *b : *a;
    recorder_->Dispatch(*twice, {}, Push{from.Address(), to.Address(), kSize, 0}, {kGroups},
                        {{from.All(), Access::kRead}, {to.All(), Access::kWrite}});
  }
  EXPECT_EQ(recorder_->NumBarriers(), 4u);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(b->All()), Each(32.0f));
}

TEST_F(RecorderTest, ManyDispatchesGetTheirDescriptorSets) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  for (int i = 0; i < 300; ++i) Axpy(i % 2 == 0 ? *a : *b, i % 2 == 0 ? *b : *a);
  PLUMB_ASSERT_OK(Finish()->Run());
  EXPECT_THAT(Read<float>(a->All()), Each(300.0f));
}

TEST_F(RecorderTest, AKernelThatReadsAndWritesTheSameBytesIsRefused) {
  const auto a = Constant(0.0f);
  Axpy(*a, *a);
  ExpectFinishFails("reads and writes the same bytes");
}

TEST_F(RecorderTest, TheWrongNumberOfBuffersIsRefused) {
  const auto a = Constant(0.0f);
  recorder_->Dispatch(*axpy_, {a->All()}, AxpyPush{1, 1.0f}, {1});
  ExpectFinishFails("1 buffers for 2 bindings");
}

TEST_F(RecorderTest, TheWrongPushConstantsAreRefused) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->Dispatch(*axpy_, {a->All(), b->All()}, Groups{1});
  ExpectFinishFails("0 bytes of push constants instead of 8");
}

TEST_F(RecorderTest, AnUnalignedSliceIsRefused) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->Dispatch(*axpy_, {a->Slice(4, 64), b->All()}, AxpyPush{1, 1.0f}, {1});
  ExpectFinishFails("binding 0 starts at 4");
}

TEST_F(RecorderTest, ASliceBeyondItsBufferIsRefused) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->Dispatch(*axpy_, {{a.get(), 0, a->SizeBytes() + 4}, b->All()}, AxpyPush{1, 1.0f}, {1});
  ExpectFinishFails("is not inside buffer 'test'");
}

TEST_F(RecorderTest, ZeroWorkgroupsAreRefused) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->Dispatch(*axpy_, {a->All(), b->All()}, AxpyPush{1, 1.0f}, {0});
  ExpectFinishFails("workgroup count 0");
}

TEST_F(RecorderTest, TheFirstMistakeIsTheOneReported) {
  const auto a = Constant(0.0f), b = Constant(0.0f);
  recorder_->Copy(a->All(), a->All());
  Axpy(*a, *a);
  ExpectFinishFails("Copy");
}

}  // namespace
}  // namespace plumb::gpu
