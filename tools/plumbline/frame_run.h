// Runs a recorded sequence through a session: what replay and bench frame share.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core/mat.hpp>

#include "plumb/map/line_map.h"
#include "plumb/map/map_index.h"
#include "plumb/runtime/session.h"
#include "tools/datasets/tum_sequence.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

struct FrameRunOptions {
  std::string sequence, frames, priors, map;
  DetectorOptions detector;
  std::string prior_size = "10,2";        // cm, deg
  std::vector<std::string> more_priors;   // FILE or FILE:CM,DEG
  std::string gravity, gravity_in_world;  // a file, X,Y,Z; empty: not known
  double gravity_sigma_deg = 1.0;
  std::string mode;               // independent | stream
  std::string method = "search";  // search | paper
  std::string points = "none";    // none | opencv
};

/// Declares --sequence, --frames, --map, --points and the detector's options.
void BindRecordingOptions(CLI::App& command, FrameRunOptions& options);

/// Declares all of them; `options.mode` is the default mode.
void BindFrameRunOptions(CLI::App& command, FrameRunOptions& options);

/// The input of a run, read and checked completely before the first frame.
struct FrameRun {
  TumSequence sequence;
  std::vector<SequenceFrame> frames;                // ascending in time
  std::vector<PosePrior> priors;                    // of the same frames
  std::vector<std::vector<PosePrior>> more_priors;  // of the same frames; empty: none
  LineMap map;
  std::unique_ptr<MapIndex> index;  // over `map`
  std::unique_ptr<LineDetector> detector;
  std::string detector_name, device;  // for reports
  SessionOptions session;
  bool with_points = false;     // SIFT points beside the lines
  std::vector<cv::Mat> images;  // of the frames, decoded beforehand; empty: read on the way

  std::span<const PosePrior> MorePriors(size_t frame) const {
    return more_priors.empty() ? std::span<const PosePrior>() : more_priors[frame];
  }
  /// Poses of all priors of a frame.
  std::vector<Rigid3> PriorPoses(size_t frame) const;
};

/// Reads everything that `options` name. Every frame needs an image, and a prior if priors are
/// named.
Outcome OpenFrameRun(const FrameRunOptions& options, FrameRun* out_run);

/// Gets frame number `index` of the run with its result, in order.
using FrameSink = std::function<Outcome(size_t index, const FrameResult& result)>;

/// Takes the run's detector; a run can be done once. The next image is read and detected while one
/// frame is refined. Stops at the first frame that fails and at the sink's first failure.
Outcome RunFrames(FrameRun* run, const FrameSink& sink);

}  // namespace plumb::tools
