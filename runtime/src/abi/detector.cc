#include "abi/detector.h"

#include "plumb/features/lsd_detector.h"

namespace plumb::abi {

Result<std::unique_ptr<LineDetector>> CreateDetector(const plumb_session_options& options,
                                                     const std::string& map_detector) {
  if (options.model != nullptr && options.model_data != nullptr) {
    return Error{ErrorCode::kInvalidArgument,
                 "options.model and options.model_data exclude each other"};
  }
  if ((options.model_data == nullptr) != (options.model_size_bytes == 0)) {
    return Error{ErrorCode::kInvalidArgument,
                 "options.model_data and options.model_size_bytes contradict each other"};
  }
  const std::string model = options.model != nullptr ? options.model : map_detector;
  if (options.model_data == nullptr && model == "lsd") return CreateLsdDetector();
  return Error{ErrorCode::kUnsupported, "this build has no detector but lsd"};
}

}  // namespace plumb::abi
