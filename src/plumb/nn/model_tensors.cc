// Names and shapes of a network's tensors, and random weights of that shape.
#include <cmath>

#include "plumb/nn/model_file.h"

namespace plumb::nn {
namespace {

using Shapes = std::map<std::string, std::vector<int64_t>, std::less<>>;

void AddConv(Shapes& shapes, const std::string& name, int64_t out, int64_t in, int64_t rows,
             int64_t columns) {
  shapes[name + ".weight"] = {out, in, rows, columns};
  shapes[name + ".bias"] = {out};
}

void AddNorm(Shapes& shapes, const std::string& name, int64_t channels) {
  for (const char* part : {".weight", ".bias", ".running_mean", ".running_var"}) {
    shapes[name + part] = {channels};
  }
}

void AddBlock(Shapes& shapes, const std::string& name, BlockKind kind, int64_t in, int64_t planes,
              bool project) {
  AddNorm(shapes, name + ".bn1", in);
  AddConv(shapes, name + ".conv1", planes, in, 1, 1);
  AddNorm(shapes, name + ".bn2", planes);
  if (kind == BlockKind::kBasic) {
    AddConv(shapes, name + ".conv2", planes, planes, 3, 3);
  } else {
    AddConv(shapes, name + ".conv2_square", planes, planes, 3, 3);
    AddConv(shapes, name + ".conv2_vertical", planes, planes, 7, 1);
    AddConv(shapes, name + ".conv2_horizontal", planes, planes, 1, 7);
    AddConv(shapes, name + ".merge", planes, 3 * planes, 1, 1);
  }
  AddNorm(shapes, name + ".bn3", planes);
  AddConv(shapes, name + ".conv3", 2 * planes, planes, 1, 1);
  if (project) AddConv(shapes, name + ".project", 2 * planes, in, 1, 1);
}

// xorshift32 and the sum of four uniforms: exact on every machine, close enough to normal.
class Random {
 public:
  explicit Random(uint32_t seed) : state_(seed * 2654435761u + 1u) {}
  float Normal() {
    float sum = 0;
    for (int i = 0; i < 4; ++i) {
      state_ ^= state_ << 13;
      state_ ^= state_ >> 17;
      state_ ^= state_ << 5;
      sum += static_cast<float>(state_ >> 8) * 0x1p-24f - 0.5f;
    }
    return sum * 1.7320508f;
  }

 private:
  uint32_t state_;
};

bool EndsWith(const std::string& text, std::string_view end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

Shapes TensorShapes(const ModelSpec& spec) {
  const int64_t w = spec.width, c = spec.channels(), p = spec.planes();
  Shapes shapes;
  AddConv(shapes, "stem.conv", w, kInputPlanes, 7, 7);
  AddNorm(shapes, "stem.bn", w);
  AddBlock(shapes, "stem.block1", BlockKind::kBasic, w, w, true);
  AddBlock(shapes, "stem.block2", BlockKind::kBasic, 2 * w, w, false);
  AddBlock(shapes, "stem.block3", BlockKind::kBasic, 2 * w, 2 * w, true);
  for (int s = 0; s < spec.stacks; ++s) {
    const std::string stack = "stack" + std::to_string(s) + ".";
    for (int level = 0; level < spec.depth; ++level) {
      const std::string prefix = stack + "hg." + std::to_string(level) + ".";
      for (const char* block : {"up1", "low1", "low3"}) {
        AddBlock(shapes, prefix + block, spec.block, c, p, false);
      }
      if (level == spec.depth - 1) AddBlock(shapes, prefix + "low2", spec.block, c, p, false);
    }
    AddBlock(shapes, stack + "res", spec.block, c, p, false);
    AddConv(shapes, stack + "fc.conv", c, c, 1, 1);
    AddNorm(shapes, stack + "fc.bn", c);
    for (const char* head : {"loc", "off", "dis"}) {
      AddConv(shapes, stack + "head." + head + ".conv1", w, c, 3, 3);
      AddConv(shapes, stack + "head." + head + ".conv2", 2, w, 1, 1);
    }
    if (s + 1 < spec.stacks) {
      AddConv(shapes, stack + "remap_feature", c, c, 1, 1);
      AddConv(shapes, stack + "remap_score", c, kOutputPlanes, 1, 1);
    }
  }
  return shapes;
}

Model RandomModel(const ModelSpec& spec, uint32_t seed) {
  Model model{.spec = spec, .tensors = {}};
  Random random(seed);
  for (const auto& [name, shape] : TensorShapes(spec)) {
    Tensor tensor{.shape = shape, .data = {}};
    int64_t count = 1;
    for (const int64_t dim : shape) count *= dim;
    const bool kernel = shape.size() == 4;
    const bool variance = EndsWith(name, ".running_var");
    const bool scale = !kernel && EndsWith(name, ".weight");
    // Half of He's gain: residual sums then grow slowly over the blocks.
    const float gain =
        kernel ? 1.0f / std::sqrt(static_cast<float>(shape[1] * shape[2] * shape[3])) : 0.1f;
    for (int64_t i = 0; i < count; ++i) {
      const float normal = gain * random.Normal();
      tensor.data.push_back(variance || scale ? 1.0f + normal : normal);
    }
    model.tensors.emplace(name, std::move(tensor));
  }
  return model;
}

}  // namespace plumb::nn
