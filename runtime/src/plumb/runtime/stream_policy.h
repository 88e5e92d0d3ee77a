// When a stream of frames is refined locally, when it is searched, and from which pose: no images,
// no map, only what a state machine needs.
#pragma once

#include <cstdint>
#include <optional>

#include "plumb/base/result.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

struct StreamOptions {
  /// Norms of the prediction's uncertainty one frame after a success, [1e-9, 1000], [1e-9, 3.2];
  /// grow with the square root of the frames since then, up to the tracker's own uncertainty.
  double position_sigma_m = 0.02;
  double rotation_sigma_rad = 0.00873;  // 0.5 deg
  /// A frame whose map support is below this share of the running mean counts as lost, in [0, 1).
  double lost_support_share = 0.7;
  /// Weight of the past in the running mean of the map support, in [0, 1).
  double support_memory = 0.9;

  /// Returns kInvalidArgument naming the first member that is out of range.
  Status Validate() const;
};

/// What the stream remembers from frame to frame. A default one has seen no frame.
struct StreamState {
  struct Anchor {
    Rigid3 cam_from_world;          // refined, or the prediction when the frame was no success
    Rigid3 tracker_cam_from_world;  // the host's pose of the same frame
  };
  std::optional<Anchor> last;
  uint32_t frames_without_success = 0;
  double mean_support = 0.0;  // running mean of the map support of refined frames; 0: none yet
};

/// A pose that was refined, or that was found to need no refinement.
inline bool IsSuccess(RefineStatus status) {
  return status == RefineStatus::kRefined || status == RefineStatus::kKeptPrior;
}

/// The prior of the local refinement: the last refined pose moved by the tracker's own motion,
/// (tracker_k * tracker_{k-1}^-1) * refined_{k-1}, with the small uncertainty of `options`.
/// @param tracker  The host's prior of this frame.
/// @return nullopt before the first frame: then the tracker's pose has to be searched from.
std::optional<PosePrior> PredictLocally(const StreamState& state, const StreamOptions& options,
                                        const PosePrior& tracker);

/// The prior of a search: the predicted pose with the tracker's full uncertainty.
PosePrior SearchPrior(const StreamState& state, const PosePrior& tracker);

/// Whether a result must not be trusted: it is no success, or explains much less of the map than
/// the frames before. The acceptance gate alone cannot tell: after a jump a wrong local optimum
/// beats the prediction.
bool IsLost(const StreamState& state, const StreamOptions& options, const RefineResult& result);

/// Whether a search's result is to be preferred to another's: successes first, then by support.
bool IsBetter(const RefineResult& a, const RefineResult& b);

/// Takes the frame's final result into the state.
/// @param predicted  Pose to carry on when the frame was no success.
void Advance(const StreamOptions& options, const Rigid3& tracker_cam_from_world,
             const Rigid3& predicted, const RefineResult& result, StreamState* state);

}  // namespace plumb
