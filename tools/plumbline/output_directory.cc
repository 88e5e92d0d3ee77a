// Directories of results that appear complete or not at all.
#include "tools/plumbline/output_directory.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include <unistd.h>

#include "plumb/base/file.h"

namespace plumb::tools {
namespace {

namespace fs = std::filesystem;

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

/// Names below `directory` as ResultFiles::holds() takes them, what a folder holds before it. A
/// folder that no result holds is not entered.
std::vector<std::string> NamesBelow(const std::string& directory, const ResultFiles& files,
                                    std::error_code* code) {
  std::vector<std::string> names;
  fs::recursive_directory_iterator entry(directory, *code), end;
  for (; !*code && entry != end; entry.increment(*code)) {
    std::string name = entry->path().lexically_relative(directory).string();
    if (entry->is_directory(*code) && !entry->is_symlink(*code)) {
      name += "/";
      if (!files.holds(name)) entry.disable_recursion_pending();
    }
    names.push_back(std::move(name));
  }
  std::sort(names.rbegin(), names.rend());
  return names;
}

/// Removes what a result holds; whatever else has come in meanwhile stays.
void RemoveResult(const std::string& directory, const ResultFiles& files) {
  std::error_code code;
  for (const std::string& name : NamesBelow(directory, files, &code)) {
    if (files.holds(name)) fs::remove(directory + "/" + name, code);
  }
  fs::remove(directory, code);
}

/// That `target`, which exists, is an empty directory or a result alone.
Outcome CheckIsResult(const std::string& target, const ResultFiles& files) {
  std::error_code code;
  const std::string no_result =
      "it exists and is no earlier result (no " + std::string(files.marker) + ")";
  if (!fs::is_directory(target, code)) return CannotCreate(target, no_result);
  const std::vector<std::string> names = NamesBelow(target, files, &code);
  if (code) return CannotCreate(target, code.message());
  if (names.empty()) return std::nullopt;
  if (std::find(names.begin(), names.end(), files.marker) == names.end()) {
    return CannotCreate(target, no_result);
  }
  const auto foreign = std::find_if_not(names.rbegin(), names.rend(), files.holds);
  if (foreign == names.rend()) return std::nullopt;
  return CannotCreate(target, "it exists and holds " + *foreign + ", which is no part of a result");
}

}  // namespace

OutputDirectory::~OutputDirectory() {
  std::error_code code;
  if (!temporary_path_.empty()) fs::remove_all(temporary_path_, code);
}

std::string PlainPath(const std::string& path) {
  fs::path plain = path;
  // Slashes and dots at the end only: before "..", a link counts.
  while (plain.has_parent_path() && plain.has_relative_path() &&
         (!plain.has_filename() || plain.filename() == ".")) {
    plain = plain.parent_path();
  }
  std::error_code code;
  // The way there must not lead through what is going to be replaced.
  if (std::find(plain.begin(), plain.end(), "..") != plain.end()) {
    const fs::path parent = fs::canonical(plain.parent_path(), code);
    if (!code && plain.filename() != "..") plain = parent / plain.filename();
  }
  if (!fs::is_symlink(plain, code)) return plain.string();
  const fs::path target = fs::canonical(plain, code);
  return code ? plain.string() : target.string();
}

Outcome CheckReplaceable(const std::string& path, const ResultFiles& files) {
  const std::string target = PlainPath(path);
  const std::string name = fs::path(target).filename().string();
  if (name.empty() || name == "." || name == "..") {
    return CannotCreate(path.empty() ? "\"\"" : path,
                        "want a directory's own name, which a result can be given");
  }
  std::error_code code;
  if (fs::exists(fs::symlink_status(target, code))) {
    if (Outcome foreign = CheckIsResult(target, files)) return foreign;
  }
  fs::path parent = fs::path(target).parent_path();
  if (parent.empty()) parent = ".";
  if (!fs::is_directory(parent, code)) {
    return CannotCreate(target, "there is no directory " + parent.string());
  }
  if (access(parent.c_str(), W_OK | X_OK) != 0) {
    return CannotCreate(target, std::generic_category().message(errno));
  }
  return std::nullopt;
}

Outcome OutputDirectory::Open(const std::string& final_path, const ResultFiles& files) {
  if (Outcome failed = CheckReplaceable(final_path, files)) return failed;
  files_ = files;
  final_path_ = PlainPath(final_path);
  std::error_code code;
  std::string temporary;
  do {
    temporary = TemporaryName(final_path_);
  } while (!fs::create_directory(temporary, code) && !code);  // false alone: it exists
  if (code) return CannotCreate(final_path_, code.message());
  temporary_path_ = temporary;
  return std::nullopt;
}

Outcome OutputDirectory::Write(const std::string& name, const std::string& bytes) {
  return WriteFile(temporary_path_ + "/" + name, bytes);
}

Outcome OutputDirectory::Commit() {
  // Others may have put files there since Open().
  if (Outcome failed = CheckReplaceable(final_path_, files_)) return failed;
  std::error_code code;
  // A directory cannot be renamed on to a filled one: the old result steps aside first and returns
  // if the new one cannot take its place.
  const std::string aside = TemporaryName(final_path_);
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
  if (replaces) RemoveResult(aside, files_);
  return std::nullopt;
}

}  // namespace plumb::tools
