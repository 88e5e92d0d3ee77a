// Reader of the safetensors container for untrusted bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "plumb/base/result.h"

namespace plumb::nn {

enum class TensorType { kF32, kF16 };

/// One tensor inside the container's bytes.
struct TensorView {
  TensorType type = TensorType::kF32;
  std::vector<int64_t> shape;  ///< 0..8 dimensions, each >= 1; none is a scalar.
  size_t num_elements = 0;
  std::span<const std::byte> bytes;  ///< num_elements * element size, little endian.
};

/// A parsed container; its views point into the parsed bytes.
struct Safetensors {
  std::map<std::string, std::string, std::less<>> metadata;
  std::map<std::string, TensorView, std::less<>> tensors;
};

inline constexpr size_t kMaxHeaderBytes = 1 << 20;
inline constexpr size_t kMaxTensors = 4096;

/// Parses a whole file: 8 bytes header length, JSON header, data.
///
/// Refused with kCorruptData: a header longer than kMaxHeaderBytes or than the file, JSON that is
/// not exactly the format's structure, more than kMaxTensors tensors, duplicate names or keys,
/// unknown types, sizes that do not multiply to the byte range, and ranges that do not cover the
/// data gap-free. Other element types than F32 and F16 are kUnsupported. Values are not looked at.
Result<Safetensors> ParseSafetensors(std::span<const std::byte> bytes);

/// Converts to fp32; false when a value is not finite. `out` has view.num_elements elements.
bool CopyToFloat(const TensorView& view, std::span<float> out);

/// IEEE half to single precision, all values.
float HalfToFloat(uint16_t half);

}  // namespace plumb::nn
