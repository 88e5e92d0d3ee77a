// Push constants and constants of shaders/image/preprocess.comp. Included by GLSL and by C++.
#ifndef PLUMB_SHADERS_IMAGE_PREPROCESS_PARAMS_H
#define PLUMB_SHADERS_IMAGE_PREPROCESS_PARAMS_H

#ifdef __cplusplus
#include <cstdint>
namespace plumb::shaders {
using uint = uint32_t;
#endif

struct PreprocessParams {
  uint in_width, in_height;          // px
  uint out_width, out_height;        // px
  float scale_x, scale_y;            // in / out
  uint offset0, offset1, offset2;    // of each plane in the buffer, bytes, multiples of 4
  uint stride0, stride1, stride2;    // of each plane's rows, bytes, multiples of 4
  float mean_r, mean_g, mean_b;      // 0..255
  float gain_r, gain_g, gain_b;      // 1 / standard deviation
};

#ifdef __cplusplus
static_assert(sizeof(PreprocessParams) == 72, "must match the GLSL layout, std430");

// Values of kFormat, in the order of plumb::PixelFormat.
constexpr uint kPreprocessGray8 = 0, kPreprocessRgb8 = 1, kPreprocessBgr8 = 2, kPreprocessNv12 = 3,
               kPreprocessNv21 = 4, kPreprocessI420 = 5;
}  // namespace plumb::shaders
#endif

#endif
