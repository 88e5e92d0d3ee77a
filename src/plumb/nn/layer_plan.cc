// Builds the fused layer list by walking the architecture once.
#include "plumb/nn/layer_plan.h"

#include <array>

#include "plumb/nn/weight_folding.h"

namespace plumb::nn {
namespace {

constexpr std::array<std::pair<int, int>, 1> kTaps1x1 = {{{0, 0}}};
// The first nine are a 3x3; then the vertical and the horizontal arms.
constexpr std::array<std::pair<int, int>, 17> kTapsCross7 = {{{-1, -1},
                                                              {-1, 0},
                                                              {-1, 1},
                                                              {0, -1},
                                                              {0, 0},
                                                              {0, 1},
                                                              {1, -1},
                                                              {1, 0},
                                                              {1, 1},
                                                              {-3, 0},
                                                              {-2, 0},
                                                              {2, 0},
                                                              {3, 0},
                                                              {0, -3},
                                                              {0, -2},
                                                              {0, 2},
                                                              {0, 3}}};
constexpr auto kTaps7x7 = [] {
  std::array<std::pair<int, int>, 49> taps{};
  for (int t = 0; t < 49; ++t) taps[t] = {t / 7 - 3, t % 7 - 3};
  return taps;
}();

class Builder {
 public:
  Builder(const Model& model, int input_width, int input_height) : model_(model) {
    plan_.input = AddFeature(kInputPlanes, input_height, input_width);
  }

  LayerPlan Build() && {
    const ModelSpec& spec = model_.spec;
    const Feature image = plan_.features[plan_.input];
    int x = AddFeature(spec.width, image.height / 2, image.width / 2);
    Layer& stem =
        AddConv("stem.conv", Taps::k7x7S2,
                Fold(ReadConv(model_, "stem.conv"), ReadNorm(model_, "stem.bn")), plan_.input, x);
    stem.relu = true;
    x = Block("stem.block1", BlockKind::kBasic, x);
    x = MaxPool("stem.pool", x);
    x = Block("stem.block2", BlockKind::kBasic, x);
    x = Block("stem.block3", BlockKind::kBasic, x);
    for (int s = 0; s < spec.stacks; ++s) x = Stack(s, x);
    plan_.output = x;
    return std::move(plan_);
  }

 private:
  int AddFeature(int channels, int height, int width) {
    plan_.features.push_back({channels, height, width});
    return static_cast<int>(plan_.features.size()) - 1;
  }

  int AddFeatureLike(int feature, int channels) {
    const Feature like = plan_.features[feature];
    return AddFeature(channels, like.height, like.width);
  }

  Layer& AddConv(const std::string& name, Taps taps, const FoldedConv& conv, int input,
                 int output) {
    Layer layer;
    layer.name = name;
    layer.taps = taps;
    layer.input = input;
    layer.output = output;
    layer.weights.assign(conv.weights.begin(), conv.weights.end());
    layer.bias.assign(conv.bias.begin(), conv.bias.end());
    plan_.layers.push_back(std::move(layer));
    return plan_.layers.back();
  }

  int MaxPool(const std::string& name, int input) {
    const Feature in = plan_.features[input];
    Layer layer;
    layer.name = name;
    layer.kind = LayerKind::kMaxPool2;
    layer.input = input;
    layer.output = AddFeature(in.channels, in.height / 2, in.width / 2);
    plan_.layers.push_back(std::move(layer));
    return plan_.layers.back().output;
  }

  // A pre-activation bottleneck. `upsampled` is added to its output.
  int Block(const std::string& name, BlockKind kind, int input, int upsampled = -1) {
    const FoldedConv conv1 =
        Fold(ReadConv(model_, name + ".conv1"), ReadNorm(model_, name + ".bn2"));
    const int reduced = AddFeatureLike(input, conv1.out);
    Layer& first = AddConv(name + ".conv1", Taps::k1x1, conv1, input, reduced);
    first.relu = true;
    const Affine norm = ReadNorm(model_, name + ".bn1");
    first.prologue_scale.assign(norm.scale.begin(), norm.scale.end());
    first.prologue_shift.assign(norm.shift.begin(), norm.shift.end());

    const bool basic = kind == BlockKind::kBasic;
    const FoldedConv conv2 =
        Fold(basic ? ReadConv(model_, name + ".conv2") : CollapseHybrid(model_, name),
             ReadNorm(model_, name + ".bn3"));
    const int middle = AddFeatureLike(input, conv2.out);
    AddConv(name + ".conv2", basic ? Taps::k3x3 : Taps::kCross7, conv2, reduced, middle).relu =
        true;

    FoldedConv conv3 = ReadConv(model_, name + ".conv3");
    const bool project = model_.tensors.contains(name + ".project.weight");
    if (project) conv3 = ConcatInputs(conv3, ReadConv(model_, name + ".project"));
    const int output = AddFeatureLike(input, conv3.out);
    Layer& last = AddConv(name + ".conv3", Taps::k1x1, conv3, middle, output);
    (project ? last.extra_input : last.residual) = input;
    last.upsampled = upsampled;
    return output;
  }

  // The low branch comes first, so that the upper block can add it on the fly.
  int Hourglass(const std::string& prefix, int level, int input) {
    const std::string name = prefix + std::to_string(level) + ".";
    int low = MaxPool(name + "pool", input);
    low = Block(name + "low1", model_.spec.block, low);
    low = level + 1 < model_.spec.depth ? Hourglass(prefix, level + 1, low)
                                        : Block(name + "low2", model_.spec.block, low);
    low = Block(name + "low3", model_.spec.block, low);
    return Block(name + "up1", model_.spec.block, input, low);
  }

  int Stack(int index, int input) {
    const std::string name = "stack" + std::to_string(index);
    int x = Hourglass(name + ".hg.", 0, input);
    x = Block(name + ".res", model_.spec.block, x);
    const int feature = AddFeatureLike(x, model_.spec.channels());
    AddConv(name + ".fc", Taps::k1x1,
            Fold(ReadConv(model_, name + ".fc.conv"), ReadNorm(model_, name + ".fc.bn")), x,
            feature)
        .relu = true;
    const FoldedConv first = MergeHeadsFirst(model_, name + ".head");
    const int hidden = AddFeatureLike(x, first.out);
    AddConv(name + ".head.conv1", Taps::k3x3, first, feature, hidden).relu = true;
    const int score = AddFeatureLike(x, kOutputPlanes);
    AddConv(name + ".head.conv2", Taps::k1x1, MergeHeadsSecond(model_, name + ".head"), hidden,
            score);
    if (index + 1 == model_.spec.stacks) return score;

    const FoldedConv remap = ConcatInputs(ReadConv(model_, name + ".remap_feature"),
                                          ReadConv(model_, name + ".remap_score"));
    const int next = AddFeatureLike(x, remap.out);
    Layer& layer = AddConv(name + ".remap", Taps::k1x1, remap, feature, next);
    layer.extra_input = score;
    layer.residual = input;
    return next;
  }

  const Model& model_;
  LayerPlan plan_;
};

}  // namespace

std::span<const std::pair<int, int>> TapOffsets(Taps taps) {
  switch (taps) {
    case Taps::k1x1:
      return kTaps1x1;
    case Taps::k3x3:
      return std::span(kTapsCross7).first(9);
    case Taps::kCross7:
      return kTapsCross7;
    case Taps::k7x7S2:
      break;
  }
  return kTaps7x7;
}

LayerPlan BuildLayerPlan(const Model& model, int input_width, int input_height) {
  return Builder(model, input_width, input_height).Build();
}

double CountMacs(const LayerPlan& plan, const Layer& layer) {
  const Feature& out = plan.features[layer.output];
  return static_cast<double>(layer.weights.size()) * out.height * out.width;
}

double CountMacs(const LayerPlan& plan) {
  double sum = 0;
  for (const Layer& layer : plan.layers) sum += CountMacs(plan, layer);
  return sum;
}

const char* ToString(Taps taps) {
  switch (taps) {
    case Taps::k1x1:
      return "1x1";
    case Taps::k3x3:
      return "3x3";
    case Taps::kCross7:
      return "cross7";
    case Taps::k7x7S2:
      break;
  }
  return "7x7s2";
}

}  // namespace plumb::nn
