// Network weights in memory, and reading them from a safetensors file with plumb.model/1 metadata.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/nn/model_spec.h"

namespace plumb::nn {

/// A dense fp32 tensor, last dimension fastest. Convolution weights are [out][in][row][column].
struct Tensor {
  std::vector<int64_t> shape;
  std::vector<float> data;
};

/// Specification and all tensors of a network, batch normalisations not folded.
/// The tensor names are those listed by TensorShapes.
struct Model {
  ModelSpec spec;
  std::map<std::string, Tensor, std::less<>> tensors;
};

/// Name and shape of every tensor that a model of this specification has, no more and no less.
std::map<std::string, std::vector<int64_t>, std::less<>> TensorShapes(const ModelSpec& spec);

/// Parses a whole safetensors file. Everything is checked before use: container, metadata,
/// the exact set of tensors and shapes, and that every value is finite.
/// @return kCorruptData for a broken container or values, kUnsupported for another schema.
Result<Model> ParseModel(std::span<const std::byte> bytes);

/// Reads and parses a file; kNotFound when it cannot be opened; messages name the path.
Result<Model> LoadModel(const std::string& path);

/// Random weights that keep activations near unit size, for benchmarks and tests; equal seeds give
/// equal weights on every machine. @param spec must be valid.
Model RandomModel(const ModelSpec& spec, uint32_t seed);

}  // namespace plumb::nn
