// Model files: metadata, the exact set of tensors, and hostile bytes.
#include "plumb/nn/model_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "nn/safetensors_bytes.h"

namespace plumb::nn {
namespace {

using ::testing::HasSubstr;

ModelSpec SmallSpec(BlockKind block = BlockKind::kHybrid, int stacks = 1) {
  ModelSpec spec;
  spec.preset = "custom";
  spec.width = 4;
  spec.stacks = stacks;
  spec.block = block;
  spec.input_width = 128;
  spec.input_height = 64;
  return spec;
}

std::string ErrorOf(const std::vector<std::byte>& bytes) {
  const auto model = ParseModel(bytes);
  return model ? "accepted" : model.error().message;
}

TEST(ModelFile, ReadsBackWhatWasWritten) {
  const Model model = RandomModel(SmallSpec(), 1);
  auto read = ParseModel(ModelBytes(model, MetadataOf(model.spec)));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->spec.width, 4);
  EXPECT_EQ(read->spec.block, BlockKind::kHybrid);
  EXPECT_EQ(read->spec.input_width, 128);
  EXPECT_EQ(read->spec.input_height, 64);
  EXPECT_EQ(read->spec.top_k, 200);
  EXPECT_EQ(read->spec.duplicate_decay, 1.0f) << "Files without it rank duplicates as they did.";
  EXPECT_EQ(read->spec.displacement_scale, 64.0f);
  EXPECT_EQ(read->spec.std[1], 22.124f);
  ASSERT_EQ(read->tensors.size(), model.tensors.size());
  for (const auto& [name, tensor] : model.tensors)
    EXPECT_EQ(read->tensors.at(name).data, tensor.data);
}

TEST(ModelFile, APresetIsAPlainName) {
  const Model model = RandomModel(SmallSpec(), 1);
  for (const std::string& name :
       {std::string("../nano"), std::string("na no"), std::string(64, 'x')}) {
    Metadata metadata = MetadataOf(model.spec);
    metadata["preset"] = name;
    EXPECT_THAT(ErrorOf(ModelBytes(model, metadata)), HasSubstr("preset"));
  }
}

TEST(ModelFile, ReadsHowDuplicatesAreRanked) {
  const Model model = RandomModel(SmallSpec(), 1);
  Metadata metadata = MetadataOf(model.spec);
  metadata["duplicate_decay"] = "0.4";
  metadata["duplicate_distance"] = "3.5";
  const auto read = ParseModel(ModelBytes(model, metadata));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->spec.duplicate_decay, 0.4f);
  EXPECT_EQ(read->spec.duplicate_distance, 3.5f);
}

TEST(ModelFile, ReadsBasicBlocksAndTwoStacks) {
  const Model model = RandomModel(SmallSpec(BlockKind::kBasic, 2), 1);
  EXPECT_EQ(ErrorOf(ModelBytes(model, MetadataOf(model.spec))), "accepted");
  EXPECT_TRUE(model.tensors.contains("stack0.remap_score.weight"));
  EXPECT_FALSE(model.tensors.contains("stack1.remap_score.weight"));
}

TEST(ModelFile, PresetsHaveTheirWidthsAndStacks) {
  EXPECT_EQ(PresetSpec("nano")->width, 16);
  EXPECT_EQ(PresetSpec("mobile")->width, 32);
  EXPECT_EQ(PresetSpec("standard")->width, 64);
  EXPECT_EQ(PresetSpec("paper")->stacks, 2);
  EXPECT_EQ(PresetSpec("paper")->channels(), 256);
  EXPECT_THAT(PresetSpec("giant").error().message, HasSubstr("'giant'"));
}

TEST(ModelFile, ParameterCountsOfTheLiteratureAreMet) {
  ModelSpec spec = *PresetSpec("standard");
  spec.block = BlockKind::kBasic;
  int64_t weights = 0;
  for (const auto& [name, shape] : TensorShapes(spec)) {
    if (name.find("running") != std::string::npos) continue;
    int64_t count = 1;
    for (const int64_t dim : shape) count *= dim;
    weights += count;
  }
  EXPECT_NEAR(static_cast<double>(weights), 3.87e6, 0.005e6);  // One stack, basic blocks.
}

TEST(ModelFile, RefusesMissingUnknownAndMisshapenTensors) {
  const Model good = RandomModel(SmallSpec(), 1);
  Model missing = good;
  missing.tensors.erase("stack0.fc.bn.bias");
  EXPECT_THAT(ErrorOf(ModelBytes(missing, MetadataOf(good.spec))),
              HasSubstr("'stack0.fc.bn.bias' is missing"));
  Model unknown = good;
  unknown.tensors["stack0.aux.weight"] = {{1}, {0.0f}};
  EXPECT_THAT(ErrorOf(ModelBytes(unknown, MetadataOf(good.spec))),
              HasSubstr("'stack0.aux.weight' is unknown"));
  Model misshapen = good;
  misshapen.tensors["stem.conv.weight"].shape = {4, 3, 49, 1};
  EXPECT_THAT(ErrorOf(ModelBytes(misshapen, MetadataOf(good.spec))),
              HasSubstr("[4,3,49,1], not [4,3,7,7]"));
}

TEST(ModelFile, RefusesValuesThatAreNotFiniteAndNegativeVariances) {
  Model model = RandomModel(SmallSpec(), 1);
  model.tensors["stem.conv.bias"].data[2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(ErrorOf(ModelBytes(model, MetadataOf(model.spec))),
              HasSubstr("'stem.conv.bias' has a value"));
  model = RandomModel(SmallSpec(), 1);
  model.tensors["stem.bn.running_var"].data[0] = -1;
  EXPECT_THAT(ErrorOf(ModelBytes(model, MetadataOf(model.spec))), HasSubstr("negative variance"));
}

TEST(ModelFile, RefusesMetadataOutOfRange) {
  const Model model = RandomModel(SmallSpec(), 1);
  const std::pair<const char*, const char*> bad[] = {{"schema", "plumb.model/2"},
                                                     {"width", "5"},
                                                     {"width", "4 "},
                                                     {"width", "1e1"},
                                                     {"width", "-4"},
                                                     {"stacks", "0"},
                                                     {"depth", "3"},
                                                     {"block", "slim"},
                                                     {"input_width", "100"},
                                                     {"input_height", "0"},
                                                     {"mean", "1,2"},
                                                     {"mean", "1,2,3,4"},
                                                     {"std", "1,0,1"},
                                                     {"std", "1,nan,1"},
                                                     {"stride", "8"},
                                                     {"top_k", "0"},
                                                     {"score_threshold", "1.5"},
                                                     {"score_threshold", ""},
                                                     {"nms_decay", "-1"},
                                                     {"duplicate_decay", "1.1"},
                                                     {"duplicate_distance", "-2"},
                                                     {"displacement_scale", "inf"}};
  for (const auto& [key, value] : bad) {
    Metadata metadata = MetadataOf(model.spec);
    metadata[key] = value;
    EXPECT_THAT(ErrorOf(ModelBytes(model, metadata)), HasSubstr("model: ")) << key << " " << value;
  }
}

TEST(ModelFile, RefusesMissingMetadata) {
  const Model model = RandomModel(SmallSpec(), 1);
  for (const auto& [key, value] : MetadataOf(model.spec)) {
    if (key == "description") continue;
    Metadata metadata = MetadataOf(model.spec);
    metadata.erase(key);
    EXPECT_THAT(ErrorOf(ModelBytes(model, metadata)), HasSubstr("'" + key + "'"));
  }
}

TEST(ModelFile, TruncatedFilesAreRefused) {
  const Model model = RandomModel(SmallSpec(), 1);
  const auto bytes = ModelBytes(model, MetadataOf(model.spec));
  for (size_t size = 0; size < bytes.size(); size += 997) {
    EXPECT_FALSE(ParseModel(std::span(bytes).first(size))) << size;
  }
}

TEST(ModelFile, BitFlipsOfTheHeaderNeverCrashAndNeverChangeShapes) {
  const Model model = RandomModel(SmallSpec(), 1);
  const auto bytes = ModelBytes(model, MetadataOf(model.spec));
  for (size_t i = 0; i < 4000; i += 3) {
    auto flipped = bytes;
    flipped[i] ^= static_cast<std::byte>(1 << (i % 8));
    const auto read = ParseModel(flipped);
    if (!read)
      EXPECT_FALSE(read.error().message.empty());
    else
      EXPECT_EQ((*read).spec.width, 4) << i;
  }
}

TEST(ModelFile, AMissingFileIsNamed) {
  const auto model = LoadModel("/nonexistent/model.safetensors");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(model.error().message, HasSubstr("/nonexistent/model.safetensors"));
}

TEST(ModelFile, RandomModelsAreReproducibleAndDifferBySeed) {
  const Model a = RandomModel(SmallSpec(), 1), b = RandomModel(SmallSpec(), 1),
              c = RandomModel(SmallSpec(), 2);
  EXPECT_EQ(a.tensors.at("stem.conv.weight").data, b.tensors.at("stem.conv.weight").data);
  EXPECT_NE(a.tensors.at("stem.conv.weight").data, c.tensors.at("stem.conv.weight").data);
}

}  // namespace
}  // namespace plumb::nn
