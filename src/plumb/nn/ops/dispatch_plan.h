// A network as kernel dispatches: what a kernel family makes of the fused layers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"

namespace plumb::nn {

/// What one binding of a dispatch refers to.
struct Operand {
  static constexpr int kConstants = -1;  ///< The dispatch's own constants.
  int tensor = kConstants;               ///< Index into DispatchPlan::tensor_bytes.
  gpu::BindingKind kind = gpu::BindingKind::kStorage;
  gpu::Access access = gpu::Access::kRead;
};

/// One dispatch. Binding i of the kernel is operands[i].
struct DispatchInfo {
  std::string name;    ///< Layer and step, for profiles.
  std::string shader;  ///< Name in the shader registry.
  std::vector<gpu::SpecConstant> spec_constants;
  std::vector<Operand> operands;
  std::vector<float> constants;  ///< Packed weights; may be empty.
  std::vector<uint32_t> push;    ///< Push constants.
  bool pushes_address = false;   ///< The 64-bit address of the constants follows them.
  gpu::Groups groups;
};

struct DispatchPlan {
  /// Size of every tensor in the family's layout: the features of the layer plan, then scratch.
  std::vector<size_t> tensor_bytes;
  std::vector<DispatchInfo> dispatches;  ///< In order of execution.
};

}  // namespace plumb::nn
