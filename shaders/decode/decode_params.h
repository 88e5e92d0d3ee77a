// Push constants, results and constants of shaders/decode/*.comp. Included by GLSL and by C++.
#ifndef PLUMB_SHADERS_DECODE_DECODE_PARAMS_H
#define PLUMB_SHADERS_DECODE_DECODE_PARAMS_H

#ifdef __cplusplus
#include <cstdint>
namespace plumb::shaders {
using uint = uint32_t;
#endif

struct ScoreParams {
  float nms_decay;        // factor on the score of cells that are no maximum of their 3 x 3
  float score_threshold;  // cells below are no candidates
};

struct EmitParams {
  float px_per_cell_x, px_per_cell_y;  // of the original image
  float displacement_scale;            // cells per unit of the displacement planes
};

// One line; pixels of the original image, the centre of its first pixel is (0, 0).
struct DecodedLine {
  float start_x, start_y;  // start_x <= end_x
  float end_x, end_y;
  float score;  // 0..1
  uint cell;    // row * width + column
};

#ifdef __cplusplus
static_assert(sizeof(ScoreParams) == 8, "must match the GLSL layout, std430");
static_assert(sizeof(EmitParams) == 12, "must match the GLSL layout, std430");
static_assert(sizeof(DecodedLine) == 24, "must match the GLSL layout, std430");

constexpr uint kDecodeHeaderBytes = 32;     // the number of lines, then padding, then the lines
constexpr uint kSelectMaxInvocations = 256;  // kMaxInvocations of select.comp
}  // namespace plumb::shaders
#endif

#endif
