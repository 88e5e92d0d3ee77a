// Weight rewrites in double precision.
#include "plumb/nn/weight_folding.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "plumb/nn/layer_plan.h"

namespace plumb::nn {
namespace {

constexpr double kNormEpsilon = 1e-5;

const std::vector<float>& Data(const Model& model, std::string_view name) {
  return model.tensors.find(name)->second.data;
}

// Row of a tap (dy, dx) among the cross's taps.
int CrossTap(int dy, int dx) {
  const auto offsets = TapOffsets(Taps::kCross7);
  const auto found = std::find(offsets.begin(), offsets.end(), std::pair(dy, dx));
  return static_cast<int>(found - offsets.begin());
}

constexpr const char* kHeads[] = {".loc", ".off", ".dis"};

}  // namespace

FoldedConv ReadConv(const Model& model, const std::string& name) {
  const Tensor& weight = model.tensors.find(name + ".weight")->second;
  FoldedConv conv;
  conv.out = static_cast<int>(weight.shape[0]);
  conv.in = static_cast<int>(weight.shape[1]);
  conv.taps = static_cast<int>(weight.shape[2] * weight.shape[3]);
  conv.weights.resize(weight.data.size());
  for (int o = 0; o < conv.out; ++o) {
    for (int i = 0; i < conv.in; ++i) {
      for (int t = 0; t < conv.taps; ++t) {
        conv.At(o, t, i) = weight.data[(static_cast<size_t>(o) * conv.in + i) * conv.taps + t];
      }
    }
  }
  const std::vector<float>& bias = Data(model, name + ".bias");
  conv.bias.assign(bias.begin(), bias.end());
  return conv;
}

Affine ReadNorm(const Model& model, const std::string& name) {
  const auto& weight = Data(model, name + ".weight");
  const auto& bias = Data(model, name + ".bias");
  const auto& mean = Data(model, name + ".running_mean");
  const auto& variance = Data(model, name + ".running_var");
  Affine norm;
  for (size_t c = 0; c < weight.size(); ++c) {
    const double scale = weight[c] / std::sqrt(static_cast<double>(variance[c]) + kNormEpsilon);
    norm.scale.push_back(scale);
    norm.shift.push_back(bias[c] - scale * mean[c]);
  }
  return norm;
}

FoldedConv Fold(FoldedConv conv, const Affine& norm) {
  const size_t row = static_cast<size_t>(conv.taps) * conv.in;
  for (int o = 0; o < conv.out; ++o) {
    for (size_t k = 0; k < row; ++k) conv.weights[o * row + k] *= norm.scale[o];
    conv.bias[o] = conv.bias[o] * norm.scale[o] + norm.shift[o];
  }
  return conv;
}

FoldedConv CollapseHybrid(const Model& model, const std::string& block) {
  const FoldedConv branches[] = {ReadConv(model, block + ".conv2_square"),
                                 ReadConv(model, block + ".conv2_vertical"),
                                 ReadConv(model, block + ".conv2_horizontal")};
  const FoldedConv merge = ReadConv(model, block + ".merge");
  FoldedConv cross;
  cross.out = merge.out;
  cross.in = branches[0].in;
  cross.taps = static_cast<int>(TapOffsets(Taps::kCross7).size());
  cross.weights.assign(static_cast<size_t>(cross.out) * cross.taps * cross.in, 0.0);
  cross.bias = merge.bias;
  for (int b = 0; b < 3; ++b) {
    const FoldedConv& branch = branches[b];
    for (int t = 0; t < branch.taps; ++t) {
      const int tap = b == 0   ? CrossTap(t / 3 - 1, t % 3 - 1)
                      : b == 1 ? CrossTap(t - 3, 0)
                               : CrossTap(0, t - 3);
      for (int o = 0; o < cross.out; ++o) {
        for (int m = 0; m < branch.out; ++m) {
          const double factor = merge.At(o, 0, b * branch.out + m);
          for (int i = 0; i < cross.in; ++i) cross.At(o, tap, i) += factor * branch.At(m, t, i);
        }
      }
    }
    for (int o = 0; o < cross.out; ++o) {
      for (int m = 0; m < branch.out; ++m) {
        cross.bias[o] += merge.At(o, 0, b * branch.out + m) * branch.bias[m];
      }
    }
  }
  return cross;
}

FoldedConv MergeHeadsFirst(const Model& model, const std::string& heads) {
  FoldedConv merged;
  for (const char* head : kHeads) {
    const FoldedConv conv = ReadConv(model, heads + head + ".conv1");
    merged.out += conv.out;
    merged.taps = conv.taps;
    merged.in = conv.in;
    merged.weights.insert(merged.weights.end(), conv.weights.begin(), conv.weights.end());
    merged.bias.insert(merged.bias.end(), conv.bias.begin(), conv.bias.end());
  }
  return merged;
}

FoldedConv MergeHeadsSecond(const Model& model, const std::string& heads) {
  FoldedConv merged;
  merged.taps = 1;
  merged.out = kOutputPlanes;
  merged.in = 3 * model.spec.width;
  merged.weights.assign(static_cast<size_t>(merged.out) * merged.in, 0.0);
  for (int h = 0; h < 3; ++h) {
    const FoldedConv conv = ReadConv(model, heads + kHeads[h] + ".conv2");
    for (int o = 0; o < conv.out; ++o) {
      for (int i = 0; i < conv.in; ++i) {
        merged.At(h * conv.out + o, 0, h * conv.in + i) = conv.At(o, 0, i);
      }
    }
    merged.bias.insert(merged.bias.end(), conv.bias.begin(), conv.bias.end());
  }
  return merged;
}

FoldedConv ConcatInputs(const FoldedConv& a, const FoldedConv& b) {
  FoldedConv both;
  both.out = a.out;
  both.taps = 1;
  both.in = a.in + b.in;
  for (int o = 0; o < both.out; ++o) {
    for (int i = 0; i < a.in; ++i) both.weights.push_back(a.At(o, 0, i));
    for (int i = 0; i < b.in; ++i) both.weights.push_back(b.At(o, 0, i));
    both.bias.push_back(a.bias[o] + b.bias[o]);
  }
  return both;
}

}  // namespace plumb::nn
