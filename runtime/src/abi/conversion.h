// Between the structs of the C interface and the library's own types.
#pragma once

#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/runtime/frame_result.h"
#include "plumb/runtime/session.h"
#include "plumbline/plumbline.h"

namespace plumb::abi {

/// `convention` must exist.
/// @return kInvalidArgument for numbers that are no pose; the message begins with the member.
Result<Rigid3> PoseFromAbi(int32_t convention, const double q_xyzw[4], const double t_m[3]);

/// `convention` must exist.
void PoseToAbi(int32_t convention, const Rigid3& cam_from_world, double q_xyzw[4], double t_m[3]);

/// The norms of the uncertainty that a covariance (row-major, rotation first) stands for.
/// @return kInvalidArgument when it is not finite, symmetric, positive semi-definite and above
/// zero; the message begins with "covariance".
Status SizesOfCovariance(const double covariance[36], PosePrior* out_prior);

/// What a converted frame borrows. Keeps its memory from frame to frame.
struct FrameLists {
  std::vector<PosePrior> more_priors;
  std::vector<PointMatch> points;
};

/// Everything of the frame. The result's lists are those of `lists` and live as long. The pose
/// convention travels in `user_kind`.
Result<SessionFrame> FrameFromAbi(const plumb_frame& frame, FrameLists* lists);

/// The pose is in the convention of the frame's prior, see FrameFromAbi.
plumb_frame_result ResultToAbi(const FrameResult& result);

Result<SessionOptions> OptionsFromAbi(const plumb_session_options& options);

}  // namespace plumb::abi
