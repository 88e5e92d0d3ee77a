// Directories of results that appear complete or not at all.
#include "tools/plumbline/output_directory.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <unistd.h>

namespace plumb::tools {
namespace {

namespace fs = std::filesystem;

std::string WithoutTrailingSlash(std::string path) {
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  return path;
}

std::string PartialName(const std::string& path) {
  return path + ".partial-" + std::to_string(getpid());
}

Failure CannotCreate(const std::string& path, const std::string& reason) {
  return {kExitCannotCreate, path + ": cannot be created: " + reason};
}

Outcome WriteFile(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  if (!file) return CannotCreate(path, std::generic_category().message(errno));
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) return Failure{kExitIo, path + ": could not be written completely"};
  return std::nullopt;
}

}  // namespace

OutputDirectory::~OutputDirectory() {
  std::error_code code;
  if (!temporary_path_.empty()) fs::remove_all(temporary_path_, code);
}

Outcome CheckReplaceable(const std::string& path, const std::string& marker) {
  const std::string target = WithoutTrailingSlash(path);
  std::error_code code;
  if (fs::exists(target, code)) {
    const bool replaceable =
        fs::is_directory(target, code) &&
        (fs::is_empty(target, code) || fs::exists(target + "/" + marker, code));
    if (!replaceable) {
      return CannotCreate(target, "it exists and is no earlier result (no " + marker + ")");
    }
  }
  const fs::path parent = fs::path(target).parent_path();
  if (!parent.empty() && !fs::is_directory(parent, code)) {
    return CannotCreate(target, "there is no directory " + parent.string());
  }
  return std::nullopt;
}

Outcome OutputDirectory::Open(const std::string& final_path, const std::string& marker) {
  if (Outcome failed = CheckReplaceable(final_path, marker)) return failed;
  final_path_ = WithoutTrailingSlash(final_path);
  std::error_code code;
  const std::string temporary = PartialName(final_path_);
  fs::remove_all(temporary, code);
  if (!fs::create_directory(temporary, code)) return CannotCreate(final_path_, code.message());
  temporary_path_ = temporary;
  return std::nullopt;
}

Outcome OutputDirectory::Write(const std::string& name, const std::string& bytes) {
  return WriteFile(temporary_path_ + "/" + name, bytes);
}

Outcome OutputDirectory::Commit() {
  std::error_code code;
  // A directory cannot be renamed on to a filled one: the old result steps aside first and returns
  // if the new one cannot take its place.
  const std::string aside = final_path_ + ".replaced-" + std::to_string(getpid());
  const bool replaces = fs::exists(final_path_, code);
  if (replaces) {
    fs::rename(final_path_, aside, code);
    if (code) return CannotCreate(final_path_, code.message());
  }
  fs::rename(temporary_path_, final_path_, code);
  if (code) {
    const std::string reason = code.message();
    if (replaces) fs::rename(aside, final_path_, code);
    return CannotCreate(final_path_, reason);
  }
  temporary_path_.clear();
  if (replaces) fs::remove_all(aside, code);
  return std::nullopt;
}

}  // namespace plumb::tools
