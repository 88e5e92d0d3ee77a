// Compiled kernels, linked into the library: no file and no compiler at run time.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace plumb::shaders {

/// SPIR-V of the kernel with this name ("image/preprocess"), static lifetime; empty if there is
/// none, which Kernel::Create() reports.
std::span<const uint32_t> Find(std::string_view name);

/// All names, in order of their registration.
std::vector<std::string_view> Names();

}  // namespace plumb::shaders
