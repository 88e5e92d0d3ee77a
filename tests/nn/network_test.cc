// The whole network against PyTorch's output and against the CPU reference.
#include "plumb/nn/network.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "nn/plan_runner.h"
#include "plumb/nn/network_bench.h"
#include "plumb/nn/reference/network_reference.h"
#include "plumb/nn/safetensors.h"

namespace plumb::nn {
namespace {

constexpr double kTolerance = 1e-4;
const std::string kData = "tests/nn/data/";

std::vector<std::byte> ReadFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::vector<char> chars{std::istreambuf_iterator<char>(stream), {}};
  const auto bytes = std::as_bytes(std::span(chars));
  return {bytes.begin(), bytes.end()};
}

struct Oracle {
  Model model;
  std::vector<float> input, output;
};

Oracle LoadOracle(const std::string& name, const std::string& folder = kData) {
  auto model = LoadModel(folder + name + ".safetensors");
  EXPECT_TRUE(model) << model.error().message;
  const auto bytes = ReadFile(folder + name + "_io.safetensors");
  auto io = ParseSafetensors(bytes);
  EXPECT_TRUE(io) << io.error().message;
  Oracle oracle{.model = *std::move(model), .input = {}, .output = {}};
  oracle.input.resize(io->tensors.at("input").num_elements);
  oracle.output.resize(io->tensors.at("output").num_elements);
  EXPECT_TRUE(CopyToFloat(io->tensors.at("input"), oracle.input));
  EXPECT_TRUE(CopyToFloat(io->tensors.at("output"), oracle.output));
  return oracle;
}

class NetworkOnDevice : public PlanTest {
 protected:
  std::vector<float> Forward(const Model& model, const NetworkOptions& options,
                             const std::vector<float>& image) {
    auto network = Network::Create(device_, model, options);
    PLUMB_EXPECT_OK(network);
    if (!network) return {};
    PLUMB_EXPECT_OK(
        gpu::UploadNow(device_, (*network)->input().All(), std::as_bytes(std::span(image))));
    auto recorder = gpu::Recorder::Create(device_);
    PLUMB_EXPECT_OK(recorder);
    (*network)->Record(**recorder);
    auto list = (*recorder)->Finish();
    PLUMB_EXPECT_OK(list);
    if (!list) return {};
    PLUMB_EXPECT_OK((*list)->Run(kCompileTimeout));
    return Read<float>((*network)->output().All());
  }
};

TEST(NetworkReference, AgreesWithPyTorch) {
  for (const char* name : {"hybrid_1", "basic_2"}) {
    const Oracle oracle = LoadOracle(name);
    const auto& spec = oracle.model.spec;
    const auto output =
        reference::RunUnfused(oracle.model, oracle.input, spec.input_width, spec.input_height);
    EXPECT_LT(RelativeError(output, oracle.output), 1e-5) << name;
    const LayerPlan plan = BuildLayerPlan(oracle.model, spec.input_width, spec.input_height);
    EXPECT_LT(RelativeError(reference::RunPlan(plan, oracle.input), oracle.output), 1e-5) << name;
  }
}

TEST_F(NetworkOnDevice, AgreesWithPyTorch) {
  for (const char* name : {"hybrid_1", "basic_2"}) {
    const Oracle oracle = LoadOracle(name);
    EXPECT_LT(RelativeError(Forward(oracle.model, {}, oracle.input), oracle.output), kTolerance)
        << name;
  }
}

TEST_F(NetworkOnDevice, EveryPresetAgreesWithPyTorch) {
  const std::string folder = PLUMB_PRESET_ORACLE;
  if (!std::filesystem::exists(folder + "nano.safetensors")) {
    GTEST_SKIP() << "no torch here wrote " << folder;
  }
  for (const char* name : {"nano", "mobile", "standard", "paper"}) {
    const Oracle oracle = LoadOracle(name, folder);
    const auto preset = PresetSpec(name);
    PLUMB_ASSERT_OK(preset);
    EXPECT_EQ(oracle.model.spec.width, preset->width) << name;
    EXPECT_EQ(oracle.model.spec.stacks, preset->stacks) << name;
    EXPECT_EQ(oracle.model.spec.block, preset->block) << name;
    EXPECT_LT(RelativeError(Forward(oracle.model, {}, oracle.input), oracle.output), kTolerance)
        << name;
  }
}

TEST_F(NetworkOnDevice, FamilyGpuAgreesWithPyTorch) {
  const Oracle oracle = LoadOracle("hybrid_1");
  const auto output = Forward(oracle.model, {.family = KernelFamily::kGpu}, oracle.input);
  EXPECT_LT(RelativeError(output, oracle.output), kTolerance);
}

TEST_F(NetworkOnDevice, AgreesWithTheReferenceOnAnOddSize) {
  ModelSpec spec;
  spec.width = 8;
  const Model model = RandomModel(spec, 5);
  const auto image = RandomValues(static_cast<size_t>(3) * 192 * 64, 6);
  const auto expected = reference::RunPlan(BuildLayerPlan(model, 192, 64), image);
  const auto output = Forward(model, {.input_width = 192, .input_height = 64}, image);
  EXPECT_LT(RelativeError(output, expected), kTolerance);
}

TEST_F(NetworkOnDevice, NanoAgreesWithTheReferenceAtItsWidths) {
  const Model model = RandomModel(*PresetSpec("nano"), 5);
  const auto image = RandomValues(static_cast<size_t>(3) * 64 * 128, 6);
  const auto expected = reference::RunPlan(BuildLayerPlan(model, 64, 128), image);
  const auto output = Forward(model, {.input_width = 64, .input_height = 128}, image);
  EXPECT_LT(RelativeError(output, expected), kTolerance);
}

TEST_F(NetworkOnDevice, TheShippedModelAgreesWithTheReference) {
  auto model = LoadModel("assets/models/nano.safetensors");
  PLUMB_ASSERT_OK(model);
  const auto image = RandomValues(static_cast<size_t>(3) * 128 * 64, 6);
  const auto expected = reference::RunUnfused(*model, image, 128, 64);
  const auto output = Forward(*model, {.input_width = 128, .input_height = 64}, image);
  EXPECT_LT(RelativeError(output, expected), kTolerance);
}

TEST_F(NetworkOnDevice, ASecondRunGivesTheSameBytes) {
  ModelSpec spec;
  spec.width = 4;
  spec.stacks = 2;
  const Model model = RandomModel(spec, 5);
  const auto image = RandomValues(static_cast<size_t>(3) * 64 * 64, 6);
  const NetworkOptions options{.input_width = 64, .input_height = 64};
  EXPECT_EQ(Forward(model, options, image), Forward(model, options, image));
}

TEST_F(NetworkOnDevice, RefusesABadSize) {
  const auto network = Network::Create(device_, RandomModel(ModelSpec(), 1), {.input_width = 100});
  ASSERT_FALSE(network);
  EXPECT_EQ(network.error().code, ErrorCode::kInvalidArgument);
}

TEST_F(NetworkOnDevice, RefusesActivationsThatNoKernelCanBind) {
  ModelSpec spec;
  spec.width = 8;
  spec.block = BlockKind::kBasic;
  const NetworkOptions options{.input_width = 4096, .input_height = 4096};
  if (device_->Info().limits.max_storage_buffer_bytes >= uint64_t{1} << 28) {
    GTEST_SKIP() << "the device binds everything";
  }
  const auto network = Network::Create(device_, RandomModel(spec, 1), options);
  ASSERT_FALSE(network);
  EXPECT_EQ(network.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(network.error().message.find("exceeds the"), std::string::npos);
}

TEST_F(NetworkOnDevice, BenchTimesEveryFrameAndLayer) {
  ModelSpec spec;
  spec.width = 4;
  spec.input_width = spec.input_height = 64;
  const Model model = RandomModel(spec, 1);
  NetworkBenchOptions options;
  options.num_frames = 3;
  options.num_warm_up = 1;
  options.times_layers = true;
  auto result = BenchNetwork(device_, model, options);
  PLUMB_ASSERT_OK(result);
  ASSERT_EQ(result->frame_ms.size(), 3u);
  for (const double ms : result->frame_ms) EXPECT_GT(ms, 0);
  EXPECT_GT(result->first_frame_ms, 0);
  if (device_->Info().timestamp_period_ns > 0) {
    EXPECT_EQ(result->layers.size(), static_cast<size_t>(result->info.num_dispatches));
  }
  options.num_frames = 0;
  EXPECT_EQ(BenchNetwork(device_, model, options).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(NetworkOnDevice, StatesItsFacts) {
  auto network = Network::Create(device_, RandomModel(ModelSpec(), 1));
  PLUMB_ASSERT_OK(network);
  const NetworkInfo& info = (*network)->info();
  EXPECT_EQ(info.output_width, 80);
  EXPECT_EQ(info.output_height, 80);
  EXPECT_NEAR(info.gmac, 0.88, 0.05);
  EXPECT_NE(info.family, KernelFamily::kAuto);
  EXPECT_EQ((*network)->input().SizeBytes(), 3u * 320u * 320u * 4u);
  EXPECT_EQ((*network)->output().SizeBytes(), 6u * 80u * 80u * 4u);
}

}  // namespace
}  // namespace plumb::nn
