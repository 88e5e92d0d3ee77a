// Memory: creation, slices, transfers.
#include "plumb/gpu/buffer.h"

#include <gmock/gmock.h>

#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::HasSubstr;

class BufferTest : public plumb::testing::GpuTest {};

std::vector<uint32_t> Words(size_t n) {
  std::vector<uint32_t> words(n);
  for (size_t i = 0; i < n; ++i) words[i] = static_cast<uint32_t>(i * 2654435761u);
  return words;
}

TEST_F(BufferTest, UploadAndReadBackGiveTheSameBytesInEveryMemory) {
  for (const MemoryUse use : {MemoryUse::kDevice, MemoryUse::kUpload, MemoryUse::kReadback}) {
    for (const size_t n : {size_t{1}, size_t{3}, size_t{100003}}) {
      const auto buffer = MakeBuffer(Words(n), use);
      EXPECT_EQ(Read<uint32_t>(buffer->All()), Words(n));
    }
  }
}

TEST_F(BufferTest, ATransferTouchesItsSliceOnly) {
  const auto buffer = MakeBuffer(std::vector<uint32_t>(64, 7));
  const std::vector<uint32_t> words = Words(4);
  PLUMB_ASSERT_OK(UploadNow(device_, buffer->Slice(128, 16), std::as_bytes(std::span(words))));
  std::vector<uint32_t> expected(64, 7);
  std::copy(words.begin(), words.end(), expected.begin() + 32);
  EXPECT_EQ(Read<uint32_t>(buffer->All()), expected);
  EXPECT_EQ(Read<uint32_t>(buffer->Slice(128, 16)), words);
}

TEST_F(BufferTest, ATransferOfTheWrongSizeIsRefused) {
  const auto buffer = MakeBuffer(Words(4));
  const std::vector<uint32_t> words = Words(3);
  const Status status = UploadNow(device_, buffer->All(), std::as_bytes(std::span(words)));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
}

TEST_F(BufferTest, OnlyHostMemoryIsMapped) {
  EXPECT_EQ(MakeBuffer(Words(4), MemoryUse::kDevice)->Data(), nullptr);
  EXPECT_NE(MakeBuffer(Words(4), MemoryUse::kUpload)->Data(), nullptr);
  EXPECT_NE(MakeBuffer(Words(4), MemoryUse::kReadback)->Data(), nullptr);
}

TEST_F(BufferTest, HasAnAddressWhereTheDeviceHasThem) {
  const bool has_addresses = device_->Info().features.buffer_device_address;
  EXPECT_EQ(MakeBuffer(Words(4))->Address() != 0, has_addresses);
}

TEST_F(BufferTest, AnEmptyBufferIsRefusedByName) {
  const auto buffer = Buffer::Create(device_, {"nothing", 0, MemoryUse::kDevice});
  ASSERT_FALSE(buffer);
  EXPECT_EQ(buffer.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(buffer.error().message, HasSubstr("'nothing'"));
}

TEST_F(BufferTest, LayoutAlignsEveryPartAndOverlapsNone) {
  const uint64_t alignment = device_->Info().limits.buffer_offset_alignment;
  BufferLayout layout(*device_);
  uint64_t end = 0;
  for (const uint64_t size : {uint64_t{1}, alignment, alignment + 1, uint64_t{12}}) {
    const uint64_t offset = layout.Append(size);
    EXPECT_EQ(offset % alignment, 0u);
    EXPECT_GE(offset, end);
    EXPECT_LT(offset, end + alignment);
    end = offset + size;
  }
  EXPECT_EQ(layout.SizeBytes(), end);
}

}  // namespace
}  // namespace plumb::gpu
