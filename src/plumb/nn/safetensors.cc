// Safetensors: header by an event-driven JSON parser that accepts nothing but the format's
// structure.
#include "plumb/nn/safetensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

namespace plumb::nn {
namespace {

constexpr size_t kPrefixBytes = 8;
constexpr size_t kMaxDims = 8;
constexpr int64_t kMaxElements = int64_t{1} << 32;

Error Corrupt(const std::string& message) {
  return Error{ErrorCode::kCorruptData, "safetensors: " + message};
}

struct HeaderEntry {
  std::string name;
  std::string dtype;
  std::vector<uint64_t> shape;
  std::vector<uint64_t> offsets;
  bool has_dtype = false, has_shape = false, has_offsets = false;
};

// Events of the header. The nesting is fixed, so the state is the depth plus the current key.
class HeaderReader : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<HeaderEntry> entries;
  std::map<std::string, std::string, std::less<>> metadata;
  std::string failure;

  bool start_object(std::size_t) override {
    if (depth_ == 0 && !started_) {
      started_ = true;
      depth_ = 1;
      return true;
    }
    if (depth_ == 1 && array_ == nullptr) {
      depth_ = 2;
      if (!in_metadata_) entries.emplace_back().name = name_;
      return true;
    }
    return Fail("an object at a place where the format has none");
  }

  bool end_object() override {
    if (depth_ == 2 && !in_metadata_) {
      const HeaderEntry& entry = entries.back();
      if (!entry.has_dtype || !entry.has_shape || !entry.has_offsets) {
        return Fail("tensor '" + entry.name + "' lacks dtype, shape or data_offsets");
      }
    }
    --depth_;
    return true;
  }

  bool key(std::string& text) override {
    if (depth_ == 1) {
      if (!names_.insert(text).second) return Fail("the name '" + text + "' occurs twice");
      name_ = text;
      in_metadata_ = text == "__metadata__";
      if (names_.size() > kMaxTensors + 1) {
        return Fail("more than " + std::to_string(kMaxTensors) + " tensors");
      }
      return true;
    }
    if (in_metadata_) {
      if (metadata.contains(text)) return Fail("the metadata key '" + text + "' occurs twice");
      key_ = text;
      return true;
    }
    HeaderEntry& entry = entries.back();
    bool* seen = text == "dtype"          ? &entry.has_dtype
                 : text == "shape"        ? &entry.has_shape
                 : text == "data_offsets" ? &entry.has_offsets
                                          : nullptr;
    if (seen == nullptr)
      return Fail("tensor '" + entry.name + "' has the unknown key '" + text + "'");
    if (*seen) return Fail("tensor '" + entry.name + "' has the key '" + text + "' twice");
    *seen = true;
    key_ = text;
    return true;
  }

  bool start_array(std::size_t) override {
    if (depth_ != 2 || in_metadata_ || array_ != nullptr || key_ == "dtype") {
      return Fail("an array at a place where the format has none");
    }
    array_ = key_ == "shape" ? &entries.back().shape : &entries.back().offsets;
    return true;
  }

  bool end_array() override {
    array_ = nullptr;
    return true;
  }

  bool number_unsigned(number_unsigned_t value) override {
    if (array_ == nullptr) return Fail("a number at a place where the format has none");
    if (array_->size() == kMaxDims) return Fail("an array of more than 8 numbers");
    array_->push_back(value);
    return true;
  }

  bool string(string_t& value) override {
    if (depth_ == 2 && in_metadata_) {
      metadata.emplace(key_, value);
      return true;
    }
    if (depth_ == 2 && array_ == nullptr && key_ == "dtype") {
      entries.back().dtype = value;
      return true;
    }
    return Fail("a string at a place where the format has none");
  }

  bool null() override { return Fail("a null"); }
  bool boolean(bool) override { return Fail("a boolean"); }
  bool number_integer(number_integer_t) override { return Fail("a negative number"); }
  bool number_float(number_float_t, const string_t&) override { return Fail("a fraction"); }
  bool binary(binary_t&) override { return Fail("binary data"); }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception&) override {
    return Fail("the JSON is broken at byte " + std::to_string(position));
  }

 private:
  bool Fail(std::string what) {
    if (failure.empty()) failure = std::move(what);
    return false;
  }

  int depth_ = 0;
  bool started_ = false;
  bool in_metadata_ = false;
  std::string name_, key_;
  std::set<std::string> names_;
  std::vector<uint64_t>* array_ = nullptr;
};

struct Range {
  uint64_t begin, end;
};

Status CheckGapFree(std::vector<Range> ranges, uint64_t data_bytes) {
  std::sort(ranges.begin(), ranges.end(), [](const Range& a, const Range& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  uint64_t next = 0;
  for (const Range& range : ranges) {
    if (range.begin != next) {
      return Corrupt("tensor data has a gap or an overlap at byte " + std::to_string(next));
    }
    next = range.end;
  }
  if (next != data_bytes) {
    return Corrupt("tensors cover " + std::to_string(next) + " bytes of data, the file has " +
                   std::to_string(data_bytes));
  }
  return Ok();
}

Result<TensorView> MakeView(const HeaderEntry& entry, std::span<const std::byte> data) {
  const std::string label = "tensor '" + entry.name + "' ";
  TensorView view;
  size_t element_bytes = 0;
  if (entry.dtype == "F32") {
    view.type = TensorType::kF32;
    element_bytes = 4;
  } else if (entry.dtype == "F16") {
    view.type = TensorType::kF16;
    element_bytes = 2;
  } else {
    return Error{ErrorCode::kUnsupported,
                 "safetensors: " + label + "has the type '" + entry.dtype + "', not F32 or F16"};
  }
  int64_t count = 1;
  for (const uint64_t dim : entry.shape) {
    if (dim == 0 || dim > static_cast<uint64_t>(kMaxElements / count)) {
      return Corrupt(label + "has an empty or oversized shape");
    }
    count *= static_cast<int64_t>(dim);
    view.shape.push_back(static_cast<int64_t>(dim));
  }
  view.num_elements = static_cast<size_t>(count);
  if (entry.offsets.size() != 2 || entry.offsets[0] > entry.offsets[1] ||
      entry.offsets[1] > data.size()) {
    return Corrupt(label + "has data_offsets outside the file");
  }
  const uint64_t bytes = entry.offsets[1] - entry.offsets[0];
  if (bytes != view.num_elements * element_bytes) {
    return Corrupt(label + "has " + std::to_string(bytes) + " bytes, its shape needs " +
                   std::to_string(view.num_elements * element_bytes));
  }
  view.bytes = data.subspan(entry.offsets[0], bytes);
  return view;
}

}  // namespace

Result<Safetensors> ParseSafetensors(std::span<const std::byte> bytes) {
  if (bytes.size() < kPrefixBytes) {
    return Corrupt("the file has " + std::to_string(bytes.size()) +
                   " bytes, a header length has 8");
  }
  uint64_t header_bytes = 0;
  for (size_t i = 0; i < kPrefixBytes; ++i) {
    header_bytes |= static_cast<uint64_t>(bytes[i]) << (8 * i);
  }
  if (header_bytes > kMaxHeaderBytes || header_bytes > bytes.size() - kPrefixBytes) {
    return Corrupt("the header length " + std::to_string(header_bytes) +
                   " exceeds the file or the limit of " + std::to_string(kMaxHeaderBytes));
  }
  const std::span header = bytes.subspan(kPrefixBytes, header_bytes);
  const std::span data = bytes.subspan(kPrefixBytes + header_bytes);
  if (header.empty() || header[0] != std::byte{'{'}) return Corrupt("the header is not an object");

  HeaderReader reader;
  const char* text = reinterpret_cast<const char*>(header.data());
  const bool parsed = nlohmann::json::sax_parse(text, text + header.size(), &reader);
  if (!parsed || !reader.failure.empty()) return Corrupt("the header has " + reader.failure);

  Safetensors result;
  result.metadata = std::move(reader.metadata);
  std::vector<Range> ranges;
  for (const HeaderEntry& entry : reader.entries) {
    Result<TensorView> view = MakeView(entry, data);
    if (!view) return view.error();
    ranges.push_back({entry.offsets[0], entry.offsets[1]});
    result.tensors.emplace(entry.name, *std::move(view));
  }
  if (const Status status = CheckGapFree(std::move(ranges), data.size()); !status) {
    return status.error();
  }
  return result;
}

float HalfToFloat(uint16_t half) {
  const uint32_t sign = static_cast<uint32_t>(half & 0x8000u) << 16;
  const uint32_t exponent = (half >> 10) & 31u;
  const uint32_t mantissa = half & 1023u;
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000u | (mantissa << 13));
  if (exponent == 0) {  // Zero or subnormal: mantissa * 2^-24.
    const float value = static_cast<float>(mantissa) * 0x1p-24f;
    return sign != 0 ? -value : value;
  }
  return std::bit_cast<float>(sign | ((exponent + 112u) << 23) | (mantissa << 13));
}

bool CopyToFloat(const TensorView& view, std::span<float> out) {
  bool finite = true;
  for (size_t i = 0; i < view.num_elements; ++i) {
    if (view.type == TensorType::kF32) {
      std::memcpy(&out[i], view.bytes.data() + 4 * i, 4);
    } else {
      uint16_t half = 0;
      std::memcpy(&half, view.bytes.data() + 2 * i, 2);
      out[i] = HalfToFloat(half);
    }
    finite = finite && std::isfinite(out[i]);
  }
  return finite;
}

}  // namespace plumb::nn
