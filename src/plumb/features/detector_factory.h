// From the name of a model to its line detector.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/features/line_detector.h"
#include "plumb/features/vlse_detector.h"

namespace plumb {

/// Makes the detector that `model` names:
/// - "lsd": OpenCV's LSD; `options` are not used;
/// - a path, recognised by a '/' or the ending ".safetensors": the VLSE network with these weights;
/// - any other name, "nano" for instance: <folder>/<name>.safetensors of the first of
///   `model_folders` that has such a file.
/// @param options  device and thresholds of a network; model_path and model_data are ignored.
/// @return kInvalidArgument for an empty name; kNotFound that names the model and the folders;
///         otherwise as VlseDetector::Create().
Result<std::unique_ptr<LineDetector>> CreateLineDetector(
    const std::string& model, const VlseDetectorOptions& options,
    const std::vector<std::string>& model_folders = {});

}  // namespace plumb
