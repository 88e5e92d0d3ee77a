#include "plumb/features/vlse_decoder.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "shaders/registry.h"

namespace plumb {
namespace {

using gpu::Access;
using gpu::BindingKind;
using gpu::SpecConstant;

constexpr int kMaxLines = 4096;      // emit.comp's loop
constexpr int kMaxSideCells = 1024;  // select.comp's loop
// Rows are multiples of four texels in the networks that we have, so that no lane idles.
constexpr uint32_t kScoreWorkgroupX = 4, kScoreWorkgroupY = 8;
constexpr uint32_t kEmitWorkgroup = 32;

Status Check(const DecodeOptions& options) {
  const auto fail = [](const std::string& what) -> Status {
    return Error{ErrorCode::kInvalidArgument, "DecodeOptions: " + what};
  };
  const auto is_fraction = [](float v) { return v >= 0.0f && v <= 1.0f; };
  if (options.width_cells < 4 || options.width_cells > kMaxSideCells ||
      options.width_cells % 4 != 0) {
    return fail("width_cells " + std::to_string(options.width_cells) +
                " is not a multiple of 4 within 4..1024");
  }
  if (options.height_cells < 1 || options.height_cells > kMaxSideCells) {
    return fail("height_cells " + std::to_string(options.height_cells) + " is outside 1..1024");
  }
  if (options.max_lines < 1 || options.max_lines > kMaxLines) {
    return fail("max_lines " + std::to_string(options.max_lines) + " is outside 1..4096");
  }
  if (!is_fraction(options.score_threshold)) {
    return fail("score_threshold " + std::to_string(options.score_threshold) + " is outside 0..1");
  }
  if (!is_fraction(options.nms_decay)) {
    return fail("nms_decay " + std::to_string(options.nms_decay) + " is outside 0..1");
  }
  return Ok();
}

}  // namespace

Result<std::unique_ptr<VlseDecoder>> VlseDecoder::Create(std::shared_ptr<gpu::Device> device,
                                                         const DecodeOptions& options,
                                                         nn::KernelFamily family) {
  if (const Status valid = Check(options); !valid) return valid.error();
  std::unique_ptr<VlseDecoder> decoder(new VlseDecoder(options));
  const gpu::DeviceInfo& info = device->Info();
  const bool is_cpu_simd =
      family == nn::KernelFamily::kAuto ? info.IsLavapipe() : family == nn::KernelFamily::kCpuSimd;
  const std::string suffix = is_cpu_simd ? "_cpu_simd" : "_gpu";
  const auto width = static_cast<uint32_t>(options.width_cells);
  const auto height = static_cast<uint32_t>(options.height_cells);
  const auto max_lines = static_cast<uint32_t>(options.max_lines);
  const BindingKind quads = is_cpu_simd ? BindingKind::kTexelRgba32F : BindingKind::kStorage;
  const BindingKind singles = is_cpu_simd ? BindingKind::kTexelR32F : BindingKind::kStorage;
  const uint32_t select_workgroup =
      is_cpu_simd ? 64u
                  : std::min(shaders::kSelectMaxInvocations, info.limits.max_workgroup_invocations);

  Status status = Ok();
  const auto make = [&](const std::string& name, std::vector<gpu::KernelBinding> bindings,
                        uint32_t push_bytes, std::vector<SpecConstant> constants) {
    auto kernel = gpu::Kernel::Create(device, {.name = "decode/" + name,
                                               .spirv = shaders::Find("decode/" + name + suffix),
                                               .bindings = std::move(bindings),
                                               .push_constant_bytes = push_bytes,
                                               .spec_constants = std::move(constants)});
    if (!kernel) status = kernel.error();
    return kernel ? std::move(*kernel) : nullptr;
  };
  decoder->score_ =
      make("score", {{0, quads, Access::kRead}, {1, BindingKind::kStorage, Access::kWrite}},
           sizeof(shaders::ScoreParams),
           {SpecConstant::Uint(0, kScoreWorkgroupX), SpecConstant::Uint(1, kScoreWorkgroupY),
            SpecConstant::Uint(2, width / 4), SpecConstant::Uint(3, height)});
  decoder->select_ =
      make("select",
           {{0, quads, Access::kRead},
            {1, BindingKind::kStorage, Access::kWrite},
            {2, BindingKind::kStorage, Access::kWrite},
            {3, BindingKind::kStorage, Access::kWrite}},
           0,
           {SpecConstant::Uint(0, select_workgroup), SpecConstant::Uint(1, width / 4 * height),
            SpecConstant::Uint(2, max_lines)});
  decoder->emit_ = make("emit",
                        {{0, quads, Access::kRead},
                         {1, BindingKind::kStorage, Access::kRead},
                         {2, BindingKind::kStorage, Access::kRead},
                         {3, singles, Access::kRead},
                         {4, BindingKind::kStorage, Access::kWrite}},
                        sizeof(shaders::EmitParams),
                        {SpecConstant::Uint(0, kEmitWorkgroup), SpecConstant::Uint(1, width),
                         SpecConstant::Uint(2, height), SpecConstant::Uint(3, max_lines)});
  if (!status) return status.error();

  const uint64_t cell_bytes = uint64_t{4} * width * height;
  const uint64_t chosen_score_bytes = uint64_t{16} * ((max_lines + 4 + 3) / 4);
  const uint64_t chosen_cell_bytes = uint64_t{4} * max_lines;
  gpu::BufferLayout layout(*device);
  const uint64_t cell_scores = layout.Append(cell_bytes);
  const uint64_t chosen_scores = layout.Append(chosen_score_bytes);
  const uint64_t chosen_cells = layout.Append(chosen_cell_bytes);
  const uint64_t chosen_count = layout.Append(4);
  auto scratch =
      gpu::Buffer::Create(device, {"decode scratch", layout.SizeBytes(), gpu::MemoryUse::kDevice});
  if (!scratch) return scratch.error();
  decoder->scratch_ = std::move(*scratch);
  decoder->cell_scores_ = decoder->scratch_->Slice(cell_scores, cell_bytes);
  decoder->chosen_scores_ = decoder->scratch_->Slice(chosen_scores, chosen_score_bytes);
  decoder->chosen_cells_ = decoder->scratch_->Slice(chosen_cells, chosen_cell_bytes);
  decoder->chosen_count_ = decoder->scratch_->Slice(chosen_count, 4);

  auto result = gpu::Buffer::Create(
      device, {"decoded lines", shaders::kDecodeHeaderBytes + sizeof(DecodedLine) * max_lines,
               gpu::MemoryUse::kReadback});
  if (!result) return result.error();
  decoder->result_ = std::move(*result);
  std::memset(decoder->result_->Data(), 0, decoder->result_->SizeBytes());
  return decoder;
}

void VlseDecoder::Record(gpu::Recorder& recorder, const gpu::BufferSlice& planes,
                         int image_width_px, int image_height_px) const {
  const auto width = static_cast<uint32_t>(options_.width_cells);
  const auto height = static_cast<uint32_t>(options_.height_cells);
  const gpu::BufferSlice logits{planes.buffer, planes.offset_bytes, uint64_t{8} * width * height};
  recorder.Dispatch(*score_, {logits, cell_scores_},
                    shaders::ScoreParams{options_.nms_decay, options_.score_threshold},
                    {(width / 4 + kScoreWorkgroupX - 1) / kScoreWorkgroupX,
                     (height + kScoreWorkgroupY - 1) / kScoreWorkgroupY});
  recorder.Dispatch(*select_, {cell_scores_, chosen_scores_, chosen_cells_, chosen_count_},
                    gpu::Groups{1});
  const shaders::EmitParams params{static_cast<float>(image_width_px) / static_cast<float>(width),
                                   static_cast<float>(image_height_px) / static_cast<float>(height),
                                   options_.displacement_scale};
  const uint32_t groups =
      (static_cast<uint32_t>(options_.max_lines) + kEmitWorkgroup - 1) / kEmitWorkgroup;
  recorder.Dispatch(*emit_, {chosen_scores_, chosen_cells_, chosen_count_, planes, result_->All()},
                    params, {groups});
}

std::span<const DecodedLine> VlseDecoder::Lines() const {
  uint32_t count = 0;
  std::memcpy(&count, result_->Data(), sizeof(count));
  const auto* lines =
      reinterpret_cast<const DecodedLine*>(result_->Data() + shaders::kDecodeHeaderBytes);
  return {lines, std::min(count, static_cast<uint32_t>(options_.max_lines))};
}

}  // namespace plumb
