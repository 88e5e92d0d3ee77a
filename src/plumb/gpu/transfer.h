// Copies between host and device memory at load time and in tests; waits for the device.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "plumb/base/result.h"
#include "plumb/gpu/buffer.h"

namespace plumb::gpu {

/// Writes `bytes` to the slice `to` of the same size (a multiple of 4) in any kind of memory.
Status UploadNow(const std::shared_ptr<Device>& device, const BufferSlice& to,
                 std::span<const std::byte> bytes);

/// Reads the slice `from` into `bytes` of the same size (a multiple of 4).
Status ReadNow(const std::shared_ptr<Device>& device, const BufferSlice& from,
               std::span<std::byte> bytes);

}  // namespace plumb::gpu
