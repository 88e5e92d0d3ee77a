// The safetensors reader accepts the format and refuses everything else with a clear error.
#include "plumb/nn/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "nn/safetensors_bytes.h"

namespace plumb::nn {
namespace {

using ::testing::HasSubstr;

std::vector<std::byte> Zeros(size_t count) { return std::vector<std::byte>(count); }

const std::string kTwoTensors =
    R"({"__metadata__":{"a":"b"},"x":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]},)"
    R"("y":{"dtype":"F16","shape":[4],"data_offsets":[24,32]}})";

std::string ErrorOf(const std::string& header, size_t data_bytes) {
  const auto result = ParseSafetensors(Container(header, Zeros(data_bytes)));
  return result ? "accepted" : result.error().message;
}

std::string OneTensor(const std::string& dtype, const std::string& shape,
                      const std::string& offsets) {
  return "{\"x\":{\"dtype\":\"" + dtype + "\",\"shape\":" + shape + ",\"data_offsets\":" + offsets +
         "}}";
}

TEST(Safetensors, ReadsTensorsAndMetadata) {
  const auto bytes = Container(kTwoTensors, Zeros(32));
  auto file = ParseSafetensors(bytes);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->metadata.at("a"), "b");
  EXPECT_EQ(file->tensors.at("x").shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(file->tensors.at("y").type, TensorType::kF16);
  EXPECT_EQ(file->tensors.at("y").bytes.data(), bytes.data() + bytes.size() - 8);
}

TEST(Safetensors, AcceptsPaddingAScalarAndAnyOrderOfData) {
  const std::string header =
      R"({"b":{"dtype":"F32","shape":[],"data_offsets":[4,8]},"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}   )";
  EXPECT_EQ(ErrorOf(header, 8), "accepted");
}

TEST(Safetensors, RefusesEveryTruncation) {
  const auto bytes = Container(kTwoTensors, Zeros(32));
  for (size_t size = 0; size < bytes.size(); ++size) {
    const auto result = ParseSafetensors(std::span(bytes).first(size));
    ASSERT_FALSE(result) << size;
    EXPECT_THAT(result.error().message, HasSubstr("safetensors: ")) << size;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
  }
}

TEST(Safetensors, EveryBitFlipOfTheHeaderIsAnErrorOrChangesOnlyText) {
  const auto bytes = Container(kTwoTensors, Zeros(32));
  int num_refused = 0, num_renamed = 0;
  for (size_t i = 0; i < bytes.size() - 32; ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      auto flipped = bytes;
      flipped[i] ^= static_cast<std::byte>(1 << bit);
      auto file = ParseSafetensors(flipped);
      if (!file) {
        ++num_refused;
        EXPECT_FALSE(file.error().message.empty());
        continue;
      }
      // Names and metadata text are the caller's to check; sizes must be untouched.
      ++num_renamed;
      size_t total = 0;
      for (const auto& [name, view] : file->tensors) total += view.bytes.size();
      EXPECT_EQ(total, 32u) << "byte " << i << " bit " << bit;
    }
  }
  EXPECT_GT(num_refused, 1000);
  EXPECT_GT(num_renamed, 0);
}

TEST(Safetensors, RefusesAHeaderLongerThanTheLimitBeforeReadingIt) {
  auto bytes = Container("{}", Zeros(0));
  bytes.resize(kMaxHeaderBytes + 100);
  bytes[0] = bytes[1] = std::byte{255};
  bytes[2] = std::byte{255};
  const auto result = ParseSafetensors(bytes);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("16777215"));
}

TEST(Safetensors, RefusesDuplicates) {
  const std::string tensor = R"({"dtype":"F32","shape":[1],"data_offsets":[0,4]})";
  EXPECT_THAT(ErrorOf("{\"x\":" + tensor + ",\"x\":" + tensor + "}", 4),
              HasSubstr("'x' occurs twice"));
  EXPECT_THAT(ErrorOf(R"({"__metadata__":{"k":"1","k":"2"}})", 0), HasSubstr("'k' occurs twice"));
  EXPECT_THAT(ErrorOf(R"({"x":{"dtype":"F32","dtype":"F32","shape":[1],"data_offsets":[0,4]}})", 4),
              HasSubstr("'dtype' twice"));
}

TEST(Safetensors, RefusesSizesThatDoNotMatchTheShape) {
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[2]", "[0,4]"), 4), HasSubstr("its shape needs 8"));
  EXPECT_THAT(ErrorOf(OneTensor("F16", "[3]", "[0,4]"), 4), HasSubstr("its shape needs 6"));
}

TEST(Safetensors, RefusesOverflowingAndEmptyShapes) {
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[4294967296,4294967296,4]", "[0,0]"), 0),
              HasSubstr("oversized"));
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[0]", "[0,0]"), 0), HasSubstr("empty"));
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[1,1,1,1,1,1,1,1,1]", "[0,4]"), 4),
              HasSubstr("more than 8"));
}

TEST(Safetensors, RefusesGapsOverlapsAndUncoveredData) {
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[1]", "[4,8]"), 8), HasSubstr("gap"));
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[1]", "[0,4]"), 8), HasSubstr("the file has 8"));
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[1]", "[0,8]"), 4), HasSubstr("outside the file"));
  EXPECT_THAT(ErrorOf(OneTensor("F32", "[1]", "[4,0]"), 4), HasSubstr("outside the file"));
  const std::string twice = R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},)"
                            R"("b":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})";
  EXPECT_THAT(ErrorOf(twice, 4), HasSubstr("overlap"));
}

TEST(Safetensors, RefusesOtherTypesAsUnsupported) {
  const auto result = ParseSafetensors(Container(OneTensor("I64", "[1]", "[0,8]"), Zeros(8)));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kUnsupported);
}

TEST(Safetensors, RefusesJsonOfAnotherStructure) {
  for (const char* header :
       {"", "[]", "{} {}", "{\"x\":1}", "{\"x\":{}}", "{\"x\":[1]}", "{\"x\":null}",
        "{\"x\":{\"y\":{}}}", "{\"__metadata__\":{\"a\":1}}", "{\"__metadata__\":{\"a\":{}}}",
        "{\"__metadata__\":{\"a\":[]}}", "{\"__metadata__\":\"a\"}",
        "{\"x\":{\"dtype\":[1],\"shape\":[1],\"data_offsets\":[0,4]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":[[1]],\"data_offsets\":[0,4]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":[-1],\"data_offsets\":[0,4]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":[1.0],\"data_offsets\":[0,4]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":1,\"data_offsets\":[0,4]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0]}}",
        "{\"x\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4],\"z\":1}}"}) {
    EXPECT_THAT(ErrorOf(header, 4), HasSubstr("safetensors: ")) << header;
  }
}

TEST(Safetensors, RefusesTooManyTensors) {
  std::string header = "{";
  for (size_t i = 0; i <= kMaxTensors + 1; ++i) {
    if (i > 0) header += ',';
    header += "\"" + std::to_string(i) + "\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[" +
              std::to_string(4 * i) + "," + std::to_string(4 * i + 4) + "]}";
  }
  EXPECT_THAT(ErrorOf(header + "}", 4 * (kMaxTensors + 2)), HasSubstr("more than 4096 tensors"));
}

TEST(Safetensors, RefusesDeepNestingWithoutRecursion) {
  EXPECT_THAT(ErrorOf(std::string(100000, '['), 0), HasSubstr("not an object"));
  EXPECT_THAT(ErrorOf("{\"x\":" + std::string(100000, '['), 0), HasSubstr("has none"));
}

TEST(Safetensors, HalvesConvertExactly) {
  EXPECT_EQ(HalfToFloat(0x3c00), 1.0f);
  EXPECT_EQ(HalfToFloat(0xc000), -2.0f);
  EXPECT_EQ(HalfToFloat(0x7bff), 65504.0f);
  EXPECT_EQ(HalfToFloat(0x0001), 0x1p-24f);
  EXPECT_EQ(HalfToFloat(0x8001), -0x1p-24f);
  EXPECT_EQ(HalfToFloat(0x0400), 0x1p-14f);
  EXPECT_TRUE(std::signbit(HalfToFloat(0x8000)));
  EXPECT_TRUE(std::isinf(HalfToFloat(0x7c00)));
  EXPECT_TRUE(std::isnan(HalfToFloat(0x7c01)));
}

TEST(Safetensors, ValuesThatAreNotFiniteAreReported) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::vector<std::byte> data(8);
    std::memcpy(data.data() + 4, &bad, 4);
    const auto bytes = Container(OneTensor("F32", "[2]", "[0,8]"), data);
    auto file = ParseSafetensors(bytes);
    ASSERT_TRUE(file);
    std::vector<float> values(2);
    EXPECT_FALSE(CopyToFloat(file->tensors.at("x"), values));
  }
}

}  // namespace
}  // namespace plumb::nn
