// Presets and range checks of ModelSpec.
#include "plumb/nn/model_spec.h"

#include <cmath>

namespace plumb::nn {
namespace {

Error Bad(const std::string& what, const std::string& value) {
  return Error{ErrorCode::kInvalidArgument, "model: " + what + " is " + value};
}

}  // namespace

Result<ModelSpec> PresetSpec(std::string_view preset) {
  ModelSpec spec;
  spec.preset = std::string(preset);
  if (preset == "nano") {
    spec.width = 16;
  } else if (preset == "mobile") {
    spec.width = 32;
  } else if (preset == "standard") {
    spec.width = 64;
  } else if (preset == "paper") {
    spec.width = 64;
    spec.stacks = 2;
  } else {
    return Error{ErrorCode::kInvalidArgument,
                 "preset '" + spec.preset + "' is none of nano, mobile, standard, paper"};
  }
  return spec;
}

Status ValidateInputSize(int width, int height) {
  for (const int side : {width, height}) {
    if (side < 64 || side > kMaxInputSide || side % 64 != 0) {
      return Bad("input size", std::to_string(width) + "x" + std::to_string(height) +
                                   ", sides must be multiples of 64 within 64.." +
                                   std::to_string(kMaxInputSide));
    }
  }
  return Ok();
}

Status Validate(const ModelSpec& spec) {
  if (spec.width < 4 || spec.width > 128 || spec.width % 4 != 0) {
    return Bad("width", std::to_string(spec.width) + ", must be a multiple of 4 within 4..128");
  }
  if (spec.stacks < 1 || spec.stacks > 4) {
    return Bad("stacks", std::to_string(spec.stacks) + ", must be within 1..4");
  }
  if (spec.depth != 4) return Bad("depth", std::to_string(spec.depth) + ", must be 4");
  if (spec.stride != 4) return Bad("stride", std::to_string(spec.stride) + ", must be 4");
  if (const Status size = ValidateInputSize(spec.input_width, spec.input_height); !size) {
    return size.error();
  }
  for (const float mean : spec.mean) {
    if (!std::isfinite(mean)) return Bad("mean", std::to_string(mean));
  }
  for (const float std : spec.std) {
    if (!std::isfinite(std) || std <= 0) return Bad("std", std::to_string(std));
  }
  if (!std::isfinite(spec.displacement_scale) || spec.displacement_scale <= 0) {
    return Bad("displacement_scale", std::to_string(spec.displacement_scale));
  }
  if (!(spec.score_threshold >= 0 && spec.score_threshold <= 1)) {
    return Bad("score_threshold", std::to_string(spec.score_threshold) + ", must be within 0..1");
  }
  if (!(spec.nms_decay >= 0 && spec.nms_decay <= 1)) {
    return Bad("nms_decay", std::to_string(spec.nms_decay) + ", must be within 0..1");
  }
  if (!(spec.duplicate_decay >= 0 && spec.duplicate_decay <= 1)) {
    return Bad("duplicate_decay", std::to_string(spec.duplicate_decay) + ", must be within 0..1");
  }
  if (!(spec.duplicate_distance >= 0 && spec.duplicate_distance <= 1e6f)) {
    return Bad("duplicate_distance",
               std::to_string(spec.duplicate_distance) + ", must be within 0..1000000");
  }
  if (spec.top_k < 1 || spec.top_k > 65536) {
    return Bad("top_k", std::to_string(spec.top_k) + ", must be within 1..65536");
  }
  return Ok();
}

const char* ToString(BlockKind block) { return block == BlockKind::kBasic ? "basic" : "hybrid"; }

}  // namespace plumb::nn
