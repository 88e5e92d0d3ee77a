// Exact rewrites of weights: batch normalisation into convolutions, hybrid blocks into one cross.
#pragma once

#include <string>
#include <vector>

#include "plumb/nn/model_file.h"

namespace plumb::nn {

/// Convolution weights in the order of Layer::weights, in double while rewrites go on.
struct FoldedConv {
  int out = 0, taps = 0, in = 0;
  std::vector<double> weights;  ///< [out][tap][in]
  std::vector<double> bias;     ///< [out]

  double& At(int o, int tap, int i) {
    return weights[(static_cast<size_t>(o) * taps + tap) * in + i];
  }
  double At(int o, int tap, int i) const {
    return weights[(static_cast<size_t>(o) * taps + tap) * in + i];
  }
};

/// y = scale * x + shift per channel.
struct Affine {
  std::vector<double> scale, shift;
};

/// A convolution of the model, taps row by row.
FoldedConv ReadConv(const Model& model, const std::string& name);

/// A batch normalisation of the model, eps 1e-5.
Affine ReadNorm(const Model& model, const std::string& name);

/// norm(conv(x)) as one convolution.
FoldedConv Fold(FoldedConv conv, const Affine& norm);

/// The three branches of a hybrid block and their merge as one convolution over the taps of
/// Taps::kCross7. Source: no non-linearity lies between them, and zero padding is the same for all.
FoldedConv CollapseHybrid(const Model& model, const std::string& block);

/// The first convolutions of the three heads stacked to one (loc, off, dis), and their second ones
/// as one block-diagonal 1x1.
FoldedConv MergeHeadsFirst(const Model& model, const std::string& heads);
FoldedConv MergeHeadsSecond(const Model& model, const std::string& heads);

/// a(x) + b(y) as one 1x1 convolution of the concatenation of x and y.
FoldedConv ConcatInputs(const FoldedConv& a, const FoldedConv& b);

}  // namespace plumb::nn
