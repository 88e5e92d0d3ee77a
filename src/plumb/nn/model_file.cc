// From safetensors bytes to a checked Model.
#include "plumb/nn/model_file.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>

#include "plumb/base/plain_name.h"
#include "plumb/nn/safetensors.h"

namespace plumb::nn {
namespace {

constexpr std::string_view kSchema = "plumb.model/1";
constexpr std::streamoff kMaxFileBytes = std::streamoff{1} << 30;

Error Corrupt(const std::string& message) {
  return Error{ErrorCode::kCorruptData, "model: " + message};
}

// Metadata values are strings; this reads them and keeps the first failure.
class Metadata {
 public:
  explicit Metadata(const Safetensors& file) : file_(file) {}

  std::string Text(const char* key) {
    const std::string* value = Find(key, true);
    return value != nullptr ? *value : std::string();
  }

  void Number(const char* key, int& out, bool required = true) { Parse(key, out, required); }
  void Number(const char* key, float& out, bool required = true) { Parse(key, out, required); }

  void List(const char* key, std::array<float, 3>& out) {
    const std::string* value = Find(key, true);
    if (value == nullptr) return;
    std::string_view rest = *value;
    for (size_t i = 0; i < out.size(); ++i) {
      const size_t comma = i + 1 < out.size() ? rest.find(',') : rest.size();
      if (comma == std::string_view::npos || !ParseAll(Trim(rest.substr(0, comma)), out[i])) {
        Fail(key, *value);
        return;
      }
      rest.remove_prefix(std::min(comma + 1, rest.size()));
    }
  }

  void Fail(const char* key, const std::string& value) {
    if (!failure) failure = "metadata " + std::string(key) + " is '" + value + "'";
  }

  std::optional<std::string> failure;

 private:
  const std::string* Find(const char* key, bool required) {
    const auto found = file_.metadata.find(key);
    if (found != file_.metadata.end()) return &found->second;
    if (required && !failure) failure = "metadata has no '" + std::string(key) + "'";
    return nullptr;
  }

  static std::string_view Trim(std::string_view text) {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
    return text;
  }

  template <typename T>
  static bool ParseAll(std::string_view text, T& out) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    return error == std::errc() && end == text.data() + text.size();
  }

  template <typename T>
  void Parse(const char* key, T& out, bool required) {
    const std::string* value = Find(key, required);
    if (value != nullptr && !ParseAll(*value, out)) Fail(key, *value);
  }

  const Safetensors& file_;
};

Result<ModelSpec> ParseSpec(const Safetensors& file) {
  const auto schema = file.metadata.find("schema");
  if (schema == file.metadata.end()) return Corrupt("metadata has no 'schema'");
  if (schema->second != kSchema) {
    return Error{ErrorCode::kUnsupported, "model: the schema is '" + schema->second + "', not '" +
                                              std::string(kSchema) + "'"};
  }
  Metadata metadata(file);
  ModelSpec spec;
  spec.preset = metadata.Text("preset");
  if (!IsPlainName(spec.preset)) metadata.Fail("preset", spec.preset);
  metadata.Number("width", spec.width);
  metadata.Number("stacks", spec.stacks);
  metadata.Number("depth", spec.depth);
  const std::string block = metadata.Text("block");
  if (block != "basic" && block != "hybrid") metadata.Fail("block", block);
  spec.block = block == "basic" ? BlockKind::kBasic : BlockKind::kHybrid;
  metadata.Number("input_width", spec.input_width);
  metadata.Number("input_height", spec.input_height);
  metadata.List("mean", spec.mean);
  metadata.List("std", spec.std);
  metadata.Number("stride", spec.stride);
  metadata.Number("displacement_scale", spec.displacement_scale);
  metadata.Number("score_threshold", spec.score_threshold);
  metadata.Number("top_k", spec.top_k);
  metadata.Number("nms_decay", spec.nms_decay, false);
  metadata.Number("duplicate_decay", spec.duplicate_decay, false);
  metadata.Number("duplicate_distance", spec.duplicate_distance, false);
  if (const auto text = file.metadata.find("description"); text != file.metadata.end()) {
    spec.description = text->second;
  }
  if (metadata.failure) return Corrupt(*metadata.failure);
  if (const Status status = Validate(spec); !status) {
    return Error{ErrorCode::kCorruptData, status.error().message};
  }
  return spec;
}

std::string ShapeText(const std::vector<int64_t>& shape) {
  std::string text = "[";
  for (size_t i = 0; i < shape.size(); ++i) {
    if (i > 0) text += ',';
    text += std::to_string(shape[i]);
  }
  text += ']';
  return text;
}

}  // namespace

Result<Model> ParseModel(std::span<const std::byte> bytes) {
  Result<Safetensors> file = ParseSafetensors(bytes);
  if (!file) return file.error();
  Result<ModelSpec> spec = ParseSpec(*file);
  if (!spec) return spec.error();
  Model model{.spec = *std::move(spec), .tensors = {}};
  const auto shapes = TensorShapes(model.spec);
  for (const auto& [name, view] : file->tensors) {
    if (!shapes.contains(name)) return Corrupt("the tensor '" + name + "' is unknown");
  }
  for (const auto& [name, shape] : shapes) {
    const auto found = file->tensors.find(name);
    if (found == file->tensors.end()) return Corrupt("the tensor '" + name + "' is missing");
    const TensorView& view = found->second;
    if (view.shape != shape) {
      return Corrupt("the tensor '" + name + "' has the shape " + ShapeText(view.shape) + ", not " +
                     ShapeText(shape));
    }
    Tensor tensor{.shape = shape, .data = std::vector<float>(view.num_elements)};
    if (!CopyToFloat(view, tensor.data)) {
      return Corrupt("the tensor '" + name + "' has a value that is not finite");
    }
    if (name.ends_with(".running_var")) {
      for (const float variance : tensor.data) {
        if (variance < 0) return Corrupt("the tensor '" + name + "' has a negative variance");
      }
    }
    model.tensors.emplace(name, std::move(tensor));
  }
  return model;
}

Result<Model> LoadModel(const std::string& path) {
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  if (!stream) return Error{ErrorCode::kNotFound, "model file '" + path + "' cannot be opened"};
  const std::streamoff size = stream.tellg();
  if (size < 0 || size > kMaxFileBytes) {
    return Error{ErrorCode::kCorruptData,
                 "model file '" + path + "' has " + std::to_string(size) + " bytes"};
  }
  std::vector<std::byte> bytes(static_cast<size_t>(size));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), size);
  if (!stream) return Error{ErrorCode::kCorruptData, "model file '" + path + "' cannot be read"};
  Result<Model> model = ParseModel(bytes);
  if (!model) {
    return Error{model.error().code, "model file '" + path + "': " + model.error().message};
  }
  return model;
}

}  // namespace plumb::nn
