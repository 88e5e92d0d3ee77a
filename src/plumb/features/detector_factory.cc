#include "plumb/features/detector_factory.h"

#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "plumb/features/lsd_detector.h"

namespace plumb {
namespace {

constexpr std::string_view kSuffix = ".safetensors";

bool IsPath(const std::string& model) {
  return model.find('/') != std::string::npos || model.ends_with(kSuffix);
}

Result<std::string> FindModel(const std::string& model, const std::vector<std::string>& folders) {
  std::string searched;
  for (const std::string& folder : folders) {
    const std::filesystem::path path =
        std::filesystem::path(folder) / (model + std::string(kSuffix));
    std::error_code error;
    if (std::filesystem::is_regular_file(path, error)) return path.string();
    searched.append(searched.empty() ? "" : ", ").append(folder);
  }
  return Error{ErrorCode::kNotFound, "model '" + model +
                                         "' is neither 'lsd' nor a path, and not in " +
                                         (searched.empty() ? "any folder" : searched)};
}

}  // namespace

Result<std::unique_ptr<LineDetector>> CreateLineDetector(
    const std::string& model, const VlseDetectorOptions& options,
    const std::vector<std::string>& model_folders) {
  if (model.empty()) return Error{ErrorCode::kInvalidArgument, "the model has no name"};
  if (model == "lsd") return CreateLsdDetector();
  VlseDetectorOptions vlse = options;
  vlse.model_data = {};
  vlse.model_path = model;
  if (!IsPath(model)) {
    Result<std::string> path = FindModel(model, model_folders);
    if (!path) return path.error();
    vlse.model_path = std::move(*path);
  }
  Result<std::unique_ptr<VlseDetector>> detector = VlseDetector::Create(vlse);
  if (!detector) return detector.error();
  return std::unique_ptr<LineDetector>(std::move(*detector));
}

}  // namespace plumb
