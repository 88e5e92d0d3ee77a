#include "plumb/gpu/transfer.h"

#include <cstring>
#include <string>

#include "plumb/gpu/recorder.h"

namespace plumb::gpu {
namespace {

Status CheckSize(const BufferSlice& slice, size_t num_bytes) {
  if (slice.buffer != nullptr && slice.size_bytes == num_bytes && num_bytes % 4 == 0) return Ok();
  return Error{ErrorCode::kInvalidArgument, "transfer of " + std::to_string(num_bytes) +
                                                " bytes with a slice of " +
                                                std::to_string(slice.size_bytes) + " bytes"};
}

Status CopyNow(const std::shared_ptr<Device>& device, const BufferSlice& from,
               const BufferSlice& to) {
  Result<std::unique_ptr<Recorder>> recorder = Recorder::Create(device, {"transfer", false});
  if (!recorder) return recorder.error();
  (*recorder)->Copy(from, to);
  Result<std::unique_ptr<CommandList>> commands = (*recorder)->Finish();
  if (!commands) return commands.error();
  return (*commands)->Run();
}

}  // namespace

Status UploadNow(const std::shared_ptr<Device>& device, const BufferSlice& to,
                 std::span<const std::byte> bytes) {
  if (const Status valid = CheckSize(to, bytes.size()); !valid) return valid.error();
  if (bytes.empty()) return Ok();
  if (to.buffer->Data() != nullptr) {
    std::memcpy(to.buffer->Data() + to.offset_bytes, bytes.data(), bytes.size());
    return Ok();
  }
  Result<std::unique_ptr<Buffer>> staging =
      Buffer::Create(device, {"upload staging", bytes.size(), MemoryUse::kUpload});
  if (!staging) return staging.error();
  std::memcpy((*staging)->Data(), bytes.data(), bytes.size());
  return CopyNow(device, (*staging)->All(), to);
}

Status ReadNow(const std::shared_ptr<Device>& device, const BufferSlice& from,
               std::span<std::byte> bytes) {
  if (const Status valid = CheckSize(from, bytes.size()); !valid) return valid.error();
  if (bytes.empty()) return Ok();
  if (from.buffer->Data() != nullptr) {
    std::memcpy(bytes.data(), from.buffer->Data() + from.offset_bytes, bytes.size());
    return Ok();
  }
  Result<std::unique_ptr<Buffer>> staging =
      Buffer::Create(device, {"read staging", bytes.size(), MemoryUse::kReadback});
  if (!staging) return staging.error();
  if (const Status copied = CopyNow(device, from, (*staging)->All()); !copied) {
    return copied.error();
  }
  std::memcpy(bytes.data(), (*staging)->Data(), bytes.size());
  return Ok();
}

}  // namespace plumb::gpu
