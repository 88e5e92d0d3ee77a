// Writes safetensors containers for tests, valid ones and broken ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "plumb/nn/model_file.h"

namespace plumb::nn {

/// 8 bytes length, header, data.
inline std::vector<std::byte> Container(const std::string& header,
                                        const std::vector<std::byte>& data) {
  std::vector<std::byte> bytes;
  for (int i = 0; i < 8; ++i) {
    bytes.push_back(
        static_cast<std::byte>((static_cast<uint64_t>(header.size()) >> (8 * i)) & 255));
  }
  for (const char c : header) bytes.push_back(static_cast<std::byte>(c));
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

using Metadata = std::map<std::string, std::string>;

inline Metadata MetadataOf(const ModelSpec& spec) {
  return {{"schema", "plumb.model/1"},
          {"preset", spec.preset},
          {"width", std::to_string(spec.width)},
          {"stacks", std::to_string(spec.stacks)},
          {"depth", "4"},
          {"block", ToString(spec.block)},
          {"input_width", std::to_string(spec.input_width)},
          {"input_height", std::to_string(spec.input_height)},
          {"mean", "109.73,103.832,98.681"},
          {"std", "22.275, 22.124, 23.229"},
          {"stride", "4"},
          {"displacement_scale", "64"},
          {"score_threshold", "0.25"},
          {"top_k", "200"},
          {"description", "test"}};
}

/// A model file with F32 tensors.
inline std::vector<std::byte> ModelBytes(const Model& model, const Metadata& metadata) {
  std::string header = "{\"__metadata__\":{";
  const char* comma = "";
  for (const auto& [key, value] : metadata) {
    header += comma;
    header += "\"" + key + "\":\"" + value + "\"";
    comma = ",";
  }
  header += "}";
  std::vector<std::byte> data;
  for (const auto& [name, tensor] : model.tensors) {
    const size_t begin = data.size();
    data.resize(begin + 4 * tensor.data.size());
    std::memcpy(data.data() + begin, tensor.data.data(), 4 * tensor.data.size());
    header += ",\"" + name + "\":{\"dtype\":\"F32\",\"shape\":[";
    comma = "";
    for (const int64_t dim : tensor.shape) {
      header += comma;
      header += std::to_string(dim);
      comma = ",";
    }
    header +=
        "],\"data_offsets\":[" + std::to_string(begin) + "," + std::to_string(data.size()) + "]}";
  }
  return Container(header + "}", data);
}

}  // namespace plumb::nn
