// Records dispatches and copies once; derives the barriers between them from what they access.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/buffer.h"
#include "plumb/gpu/command_list.h"
#include "plumb/gpu/hazard_tracker.h"
#include "plumb/gpu/kernel.h"

namespace plumb::gpu {

struct Groups {
  uint32_t x = 1, y = 1, z = 1;
};

/// An access through a buffer_reference address, which the binding table cannot show.
struct AddressAccess {
  BufferSlice slice;
  Access access = Access::kRead;
};

struct RecorderOptions {
  std::string name;             // for error messages
  bool has_stage_times = true;  // timestamps at BeginStage()
};

/// Calls are recorded in order; a barrier is put before a call that touches bytes which an earlier
/// call wrote, or writes bytes which an earlier call read. Calls without such a conflict may run
/// at the same time. The first mistake (wrong number of buffers, a slice out of range or unaligned,
/// a kernel that reads and writes the same bytes) is kept and returned by Finish().
class Recorder {
 public:
  static Result<std::unique_ptr<Recorder>> Create(const std::shared_ptr<Device>& device,
                                                  RecorderOptions options = {});
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Names the calls up to the next BeginStage() or Finish(); their GPU time is measured.
  void BeginStage(const std::string& name);

  /// Runs `groups` workgroups of `kernel`.
  /// @param buffers  one slice per entry of Kernel::Bindings(), in that order
  /// @param push     Kernel::PushConstantBytes() bytes, copied
  /// @param through_addresses  what the kernel accesses through addresses in `push`
  void Dispatch(const Kernel& kernel, std::span<const BufferSlice> buffers,
                std::span<const std::byte> push, Groups groups,
                std::span<const AddressAccess> through_addresses = {});

  /// The same with a push constant struct.
  template <typename Push>
  requires std::is_trivially_copyable_v<Push> && std::is_class_v<Push>
  void Dispatch(const Kernel& kernel, std::initializer_list<BufferSlice> buffers, const Push& push,
                Groups groups, std::initializer_list<AddressAccess> through_addresses = {}) {
    Dispatch(kernel, std::span(buffers.begin(), buffers.size()), std::as_bytes(std::span(&push, 1)),
             groups, std::span(through_addresses.begin(), through_addresses.size()));
  }

  /// The same for a kernel without push constants.
  void Dispatch(const Kernel& kernel, std::initializer_list<BufferSlice> buffers, Groups groups,
                std::initializer_list<AddressAccess> through_addresses = {}) {
    Dispatch(kernel, std::span(buffers.begin(), buffers.size()), std::span<const std::byte>(),
             groups, std::span(through_addresses.begin(), through_addresses.size()));
  }

  /// Copies bytes; both slices of the same size, a multiple of 4, and not overlapping.
  void Copy(const BufferSlice& from, const BufferSlice& to);

  /// Fills a slice (offset and size multiples of 4) with a repeated 32-bit value.
  void Fill(const BufferSlice& slice, uint32_t value);

  /// Ends the recording; the recorder is spent.
  Result<std::unique_ptr<CommandList>> Finish();

  size_t NumDispatches() const { return num_dispatches_; }
  size_t NumBarriers() const { return num_barriers_; }

 private:
  Recorder(std::shared_ptr<Device> device, RecorderOptions options);
  void Fail(ErrorCode code, const std::string& what);
  bool CheckSlice(const BufferSlice& slice, const std::string& user);
  bool CheckDispatch(const Kernel& kernel, std::span<const BufferSlice> buffers,
                     std::span<const std::byte> push, Groups groups);
  void Synchronize(std::span<const BufferUse> uses);
  void* DescriptorSet(const Kernel& kernel, std::span<const BufferSlice> buffers);
  void* TexelView(BindingKind kind, const BufferSlice& slice);

  std::shared_ptr<Device> device_;
  RecorderOptions options_;
  std::unique_ptr<CommandList::Resources> resources_;
  HazardTracker hazards_;
  std::vector<BufferUse> uses_;  // of the call being recorded
  std::optional<Error> error_;
  size_t num_dispatches_ = 0, num_barriers_ = 0;
};

}  // namespace plumb::gpu
