// The network as a short list of fused layers, the form in which every kernel family runs it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "plumb/nn/model_file.h"

namespace plumb::nn {

/// Shape of one activation, planar [channels][height][width] as far as this list is concerned.
struct Feature {
  int channels = 0;
  int height = 0;
  int width = 0;
};

/// Input pixels that contribute to an output pixel; outside the image they count as zero.
enum class Taps {
  k1x1,
  k3x3,
  kCross7,  ///< Union of 3x3, 7x1 and 1x7: 17 taps.
  k7x7S2,   ///< Stride 2, the stem.
};

enum class LayerKind { kConv, kMaxPool2 };

/// out = epilogue(bias + sum over taps and inputs of weight * prologue(in)).
///
/// prologue(x) = max(0, scale * x + shift), on `input` only, not on the padding;
/// epilogue(y) = relu?(y) + residual + nearest 2x upsampling of `upsampled`.
struct Layer {
  std::string name;  ///< Tensor prefix of the model, for messages and profiles.
  LayerKind kind = LayerKind::kConv;
  Taps taps = Taps::k1x1;
  int input = -1;        ///< Index of a Feature, as all below; -1 is none.
  int extra_input = -1;  ///< k1x1 only: its channels follow those of `input`; no prologue.
  int residual = -1;     ///< Same shape as the output.
  int upsampled = -1;    ///< Half the output's height and width.
  int output = -1;
  bool relu = false;
  std::vector<float> prologue_scale, prologue_shift;  ///< Per channel of `input`, or empty.
  std::vector<float> weights;                         ///< [out][tap][in and extra_input].
  std::vector<float> bias;                            ///< [out]
};

struct LayerPlan {
  std::vector<Feature> features;
  std::vector<Layer> layers;  ///< In order of execution.
  int input = 0;              ///< Feature of the image tensor.
  int output = 0;             ///< Feature of the six output planes.
};

/// (row, column) offsets of the taps, in the order of Layer::weights.
/// k7x7S2 counts from the output pixel times two.
std::span<const std::pair<int, int>> TapOffsets(Taps taps);

/// Folds batch normalisations into the convolutions before them, the hybrid block's branches and
/// merge into one cross convolution, the heads into two convolutions, and additions, upsampling and
/// batch normalisation + ReLU after additions into the neighbouring convolutions. Exact but for
/// rounding. @param input_width, input_height  must satisfy ValidateInputSize.
LayerPlan BuildLayerPlan(const Model& model, int input_width, int input_height);

/// Multiply-adds of a layer and of the plan.
double CountMacs(const LayerPlan& plan, const Layer& layer);
double CountMacs(const LayerPlan& plan);

const char* ToString(Taps taps);

}  // namespace plumb::nn
