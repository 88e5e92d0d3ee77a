// What a VLSE network looks like and how its input and output are to be read.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "plumb/base/result.h"

namespace plumb::nn {

/// Kind of the residual blocks of the hourglasses (the stem is always basic).
enum class BlockKind {
  kBasic,   ///< 1x1, 3x3, 1x1.
  kHybrid,  ///< 1x1, {3x3 | 7x1 | 1x7} merged by a 1x1, 1x1.
};

/// Architecture and metadata of one network (schema plumb.model/1).
///
/// Source: the VLSE network of Gao et al., "Pose Refinement with Joint Optimization of Visual
/// Points and Lines", a stacked hourglass of L-CNN / F-Clip.
struct ModelSpec {
  std::string preset = "nano";  ///< nano | mobile | standard | paper | custom.
  int width = 16;               ///< Channels of the stem, 4..128, multiple of 4.
  int stacks = 1;               ///< Hourglasses, 1..4.
  int depth = 4;                ///< Levels of an hourglass; 4 is the only value.
  BlockKind block = BlockKind::kHybrid;
  int input_width = 320;                                      ///< Pixels, multiple of 64.
  int input_height = 320;                                     ///< Pixels, multiple of 64.
  std::array<float, 3> mean = {109.730f, 103.832f, 98.681f};  ///< RGB, 0..255.
  std::array<float, 3> std = {22.275f, 22.124f, 23.229f};     ///< RGB, 0..255, positive.
  int stride = 4;                                             ///< Input pixels per output cell.
  float displacement_scale = 1.0f;  ///< Output planes 4, 5 times this are cells.
  float score_threshold = 0.1f;     ///< Default of the decoder, 0..1.
  int top_k = 300;                  ///< Default of the decoder.
  float nms_decay = 0.8f;           ///< Factor on the score of non-maxima, 0..1.
  float duplicate_decay = 1.0f;     ///< Factor on a line's score for every better one as near as
  float duplicate_distance = 2.0f;  ///< this: squared distances of the ends, summed, in cells.
  std::string description;

  int channels() const { return 4 * width; }  ///< Of the hourglass stream.
  int planes() const { return 2 * width; }    ///< Inside the hourglass's blocks.
};

inline constexpr int kInputPlanes = 3;   ///< R, G, B.
inline constexpr int kOutputPlanes = 6;  ///< loc logits 2, off logits 2 (x, y), dis 2 (dx, dy).
inline constexpr int kMaxInputSide = 4096;

/// Architecture of a named preset (nano, mobile, standard, paper) with hybrid blocks.
/// @return kInvalidArgument for an unknown name.
Result<ModelSpec> PresetSpec(std::string_view preset);

/// Checks every range stated at the members of ModelSpec; kInvalidArgument names the first bad one.
Status Validate(const ModelSpec& spec);

/// Checks an input size: both sides multiples of 64 within 64..kMaxInputSide.
Status ValidateInputSize(int width, int height);

const char* ToString(BlockKind block);

}  // namespace plumb::nn
