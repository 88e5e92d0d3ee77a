#include "plumb/features/blurred_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr int kRadius = 4;  // Four sigma: what is left out is below 1e-4 of the weight.
constexpr int kTaps = 2 * kRadius + 1;

// Half of the kernel, from the centre outwards; the whole sums to one.
std::array<float, kRadius + 1> GaussianHalf() {
  std::array<double, kRadius + 1> g{};
  double sum = 0.0;
  for (int i = 0; i <= kRadius; ++i) {
    g[static_cast<size_t>(i)] = std::exp(-0.5 * i * i);
    sum += (i == 0 ? 1.0 : 2.0) * g[static_cast<size_t>(i)];
  }
  std::array<float, kRadius + 1> half{};
  for (size_t i = 0; i < half.size(); ++i) half[i] = static_cast<float>(g[i] / sum);
  return half;
}

// ... 2 1 | 0 1 2 ... n-1 | n-2 n-3 ..., for any i and n >= 1.
int MirrorIndex(int i, int n) {
  if (n == 1) return 0;
  const int period = 2 * (n - 1);
  i = std::abs(i) % period;
  return i < n ? i : period - i;
}

PLUMB_SIMD_CLONES
void BlurRow(const float* padded, int width, const float* k, float* out) {
  for (int x = 0; x < width; ++x) {
    const float* p = padded + x + kRadius;
    out[x] = k[0] * p[0] + k[1] * (p[-1] + p[1]) + k[2] * (p[-2] + p[2]) + k[3] * (p[-3] + p[3]) +
             k[4] * (p[-4] + p[4]);
  }
}

PLUMB_SIMD_CLONES
void BlurColumn(const float* const* rows, int width, const float* k, float* out) {
  const float *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4],
              *r5 = rows[5], *r6 = rows[6], *r7 = rows[7], *r8 = rows[8];
  for (int x = 0; x < width; ++x) {
    out[x] = k[0] * r4[x] + k[1] * (r3[x] + r5[x]) + k[2] * (r2[x] + r6[x]) +
             k[3] * (r1[x] + r7[x]) + k[4] * (r0[x] + r8[x]);
  }
}

void LoadRow(const GrayView& gray, int y, float* padded) {
  const uint8_t* row = gray.Row(y);
  for (int x = 0; x < gray.width_px; ++x) padded[x + kRadius] = static_cast<float>(row[x]);
  for (int i = 1; i <= kRadius; ++i) {
    padded[kRadius - i] = static_cast<float>(row[MirrorIndex(-i, gray.width_px)]);
    padded[kRadius + gray.width_px - 1 + i] =
        static_cast<float>(row[MirrorIndex(gray.width_px - 1 + i, gray.width_px)]);
  }
}

}  // namespace

void BlurredImage::Assign(const GrayView& gray) {
  static const std::array<float, kRadius + 1> kernel = GaussianHalf();
  width_px_ = gray.width_px;
  height_px_ = gray.height_px;
  const size_t width = static_cast<size_t>(width_px_);
  pixels_.resize((width + 1) * (static_cast<size_t>(height_px_) + 1));
  rows_.resize(kTaps * width);
  padded_.resize(width + 2 * kRadius);

  // Row y of the input lives in slot y mod kTaps until row y + kRadius of the output is done.
  const auto slot = [&](int y) { return rows_.data() + static_cast<size_t>(y % kTaps) * width; };
  int num_loaded = 0;
  for (int y = 0; y < height_px_; ++y) {
    for (; num_loaded < std::min(y + kRadius + 1, height_px_); ++num_loaded) {
      LoadRow(gray, num_loaded, padded_.data());
      BlurRow(padded_.data(), width_px_, kernel.data(), slot(num_loaded));
    }
    const float* rows[kTaps];
    for (int i = 0; i < kTaps; ++i) rows[i] = slot(MirrorIndex(y + i - kRadius, height_px_));
    float* out = pixels_.data() + static_cast<size_t>(y) * (width + 1);
    BlurColumn(rows, width_px_, kernel.data(), out);
    out[width] = out[width - 1];
  }
  const float* last = pixels_.data() + static_cast<size_t>(height_px_ - 1) * (width + 1);
  std::copy(last, last + width + 1, pixels_.data() + static_cast<size_t>(height_px_) * (width + 1));
}

}  // namespace plumb
