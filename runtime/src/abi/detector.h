// The line detector that a session's options ask for.
#pragma once

#include <memory>
#include <string>

#include "plumb/base/result.h"
#include "plumb/features/line_detector.h"
#include "plumbline/plumbline.h"

namespace plumb::abi {

/// @param map_detector  Detector that made the map, used when the options name none.
/// @return kInvalidArgument for contradicting options; kNotFound, kCorruptData for a model;
///         kNotFound, kUnsupported for a device.
Result<std::unique_ptr<LineDetector>> CreateDetector(const plumb_session_options& options,
                                                     const std::string& map_detector);

}  // namespace plumb::abi
