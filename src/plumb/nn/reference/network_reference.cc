// Mirrors the training code's forward pass operation by operation.
#include "plumb/nn/reference/network_reference.h"

#include <algorithm>
#include <cmath>

namespace plumb::nn::reference {
namespace {

struct Map {
  int channels, height, width;
  Plane data;
  size_t pixels() const { return static_cast<size_t>(height) * width; }
};

class Unfused {
 public:
  explicit Unfused(const Model& model) : model_(model) {}

  Plane Run(Map x) {
    x = Relu(Norm(Conv(x, "stem.conv", 2), "stem.bn"));
    x = Block(x, "stem.block1", BlockKind::kBasic);
    x = MaxPool(x);
    x = Block(x, "stem.block2", BlockKind::kBasic);
    x = Block(x, "stem.block3", BlockKind::kBasic);
    Map score{};
    for (int s = 0; s < model_.spec.stacks; ++s) {
      const std::string name = "stack" + std::to_string(s);
      const BlockKind kind = model_.spec.block;
      const Map y = Block(Hourglass(x, name + ".hg.", 0), name + ".res", kind);
      const Map feature = Relu(Norm(Conv(y, name + ".fc.conv"), name + ".fc.bn"));
      score = Concat(Concat(Head(feature, name + ".head.loc"), Head(feature, name + ".head.off")),
                     Head(feature, name + ".head.dis"));
      if (s + 1 < model_.spec.stacks) {
        x = Add(Add(x, Conv(feature, name + ".remap_feature")), Conv(score, name + ".remap_score"));
      }
    }
    return score.data;
  }

 private:
  const Tensor& Get(const std::string& name) const { return model_.tensors.find(name)->second; }

  // Padding = half the kernel in each direction.
  Map Conv(const Map& x, const std::string& name, int stride = 1) const {
    const Tensor& weight = Get(name + ".weight");
    const Tensor& bias = Get(name + ".bias");
    const int out = static_cast<int>(weight.shape[0]), in = static_cast<int>(weight.shape[1]);
    const int rows = static_cast<int>(weight.shape[2]), columns = static_cast<int>(weight.shape[3]);
    Map y{out, x.height / stride, x.width / stride, {}};
    y.data.resize(y.pixels() * out);
    std::vector<double> sums(y.pixels());
    for (int o = 0; o < out; ++o) {
      std::fill(sums.begin(), sums.end(), static_cast<double>(bias.data[o]));
      for (int i = 0; i < in; ++i) {
        for (int ky = 0; ky < rows; ++ky) {
          for (int kx = 0; kx < columns; ++kx) {
            const double w =
                weight.data[((static_cast<size_t>(o) * in + i) * rows + ky) * columns + kx];
            for (int r = 0; r < y.height; ++r) {
              const int row = r * stride + ky - rows / 2;
              if (row < 0 || row >= x.height) continue;
              for (int c = 0; c < y.width; ++c) {
                const int column = c * stride + kx - columns / 2;
                if (column < 0 || column >= x.width) continue;
                sums[static_cast<size_t>(r) * y.width + c] +=
                    w * x.data[(static_cast<size_t>(i) * x.height + row) * x.width + column];
              }
            }
          }
        }
      }
      std::transform(sums.begin(), sums.end(), y.data.begin() + o * y.pixels(),
                     [](double sum) { return static_cast<float>(sum); });
    }
    return y;
  }

  Map Norm(Map x, const std::string& name) const {
    for (int c = 0; c < x.channels; ++c) {
      const double deviation = std::sqrt(Get(name + ".running_var").data[c] + 1e-5);
      for (size_t p = 0; p < x.pixels(); ++p) {
        float& v = x.data[c * x.pixels() + p];
        v = static_cast<float>((v - Get(name + ".running_mean").data[c]) / deviation *
                                   Get(name + ".weight").data[c] +
                               Get(name + ".bias").data[c]);
      }
    }
    return x;
  }

  static Map Relu(Map x) {
    for (float& v : x.data) v = std::max(0.0f, v);
    return x;
  }

  static Map Add(Map a, const Map& b) {
    for (size_t i = 0; i < a.data.size(); ++i) a.data[i] += b.data[i];
    return a;
  }

  static Map Concat(Map a, const Map& b) {
    a.channels += b.channels;
    a.data.insert(a.data.end(), b.data.begin(), b.data.end());
    return a;
  }

  static Map MaxPool(const Map& x) {
    Map y{x.channels, x.height / 2, x.width / 2, {}};
    for (int c = 0; c < y.channels; ++c) {
      for (int r = 0; r < y.height; ++r) {
        for (int k = 0; k < y.width; ++k) {
          const size_t i = (static_cast<size_t>(c) * x.height + 2 * r) * x.width + 2 * k;
          y.data.push_back(
              std::max({x.data[i], x.data[i + 1], x.data[i + x.width], x.data[i + x.width + 1]}));
        }
      }
    }
    return y;
  }

  static Map Upsample(const Map& x) {
    Map y{x.channels, 2 * x.height, 2 * x.width, {}};
    for (int c = 0; c < y.channels; ++c) {
      for (int r = 0; r < y.height; ++r) {
        for (int k = 0; k < y.width; ++k) {
          y.data.push_back(x.data[(static_cast<size_t>(c) * x.height + r / 2) * x.width + k / 2]);
        }
      }
    }
    return y;
  }

  Map Block(const Map& x, const std::string& name, BlockKind kind) const {
    Map y = Conv(Relu(Norm(x, name + ".bn1")), name + ".conv1");
    y = Relu(Norm(y, name + ".bn2"));
    if (kind == BlockKind::kBasic) {
      y = Conv(y, name + ".conv2");
    } else {
      const Map square = Conv(y, name + ".conv2_square");
      const Map vertical = Conv(y, name + ".conv2_vertical");
      y = Conv(Concat(Concat(square, vertical), Conv(y, name + ".conv2_horizontal")),
               name + ".merge");
    }
    y = Conv(Relu(Norm(y, name + ".bn3")), name + ".conv3");
    const bool project = model_.tensors.contains(name + ".project.weight");
    return Add(y, project ? Conv(x, name + ".project") : x);
  }

  Map Hourglass(const Map& x, const std::string& prefix, int level) const {
    const BlockKind kind = model_.spec.block;
    const std::string name = prefix + std::to_string(level) + ".";
    const Map up = Block(x, name + "up1", kind);
    Map low = Block(MaxPool(x), name + "low1", kind);
    low = level + 1 < model_.spec.depth ? Hourglass(low, prefix, level + 1)
                                        : Block(low, name + "low2", kind);
    return Add(up, Upsample(Block(low, name + "low3", kind)));
  }

  Map Head(const Map& x, const std::string& name) const {
    return Conv(Relu(Conv(x, name + ".conv1")), name + ".conv2");
  }

  const Model& model_;
};

}  // namespace

Plane RunUnfused(const Model& model, const Plane& image, int width, int height) {
  return Unfused(model).Run({kInputPlanes, height, width, image});
}

}  // namespace plumb::nn::reference
