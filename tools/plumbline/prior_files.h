// Files with the coarse poses of a recorded sequence.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "plumb/runtime/pose_refiner.h"
#include "tools/datasets/tum_sequence.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// What is within it of a frame's time belongs to that frame.
inline constexpr int64_t kSameFrameNs = 1'000'000;

/// "CM,DEG", the value of `option`, into two positive numbers in the range of the refinement.
Outcome ParsePoseSize(const std::string& option, const std::string& text, double* out_cm,
                      double* out_deg);

/// The prior of every frame, in the frames' order.
/// @param size  CM,DEG.
Outcome ReadPriors(const std::string& path, const std::string& size,
                   const std::vector<SequenceFrame>& frames, std::vector<PosePrior>* out_priors);

/// Further priors of the frames, in the files' order; a file need not have one for every frame.
/// @param files         FILE or FILE:CM,DEG, split at the last colon.
/// @param default_size  CM,DEG of files without.
/// @param out_priors    One list a frame.
Outcome ReadMorePriors(const std::vector<std::string>& files, const std::string& default_size,
                       const std::vector<SequenceFrame>& frames,
                       std::vector<std::vector<PosePrior>>* out_priors);

}  // namespace plumb::tools
