// Directories of results that appear complete or not at all.
#pragma once

#include <string>

#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Checks that a directory of results could take its place at `path`: the parent exists and nothing
/// is there but an empty directory or an earlier result, which holds a file named `marker`.
/// @return kExitCannotCreate otherwise.
Outcome CheckReplaceable(const std::string& path, const std::string& marker);

/// Results are written into a temporary directory beside the final place; Commit() renames it. What
/// was not committed is removed with the object, so that an error leaves nothing behind.
class OutputDirectory {
 public:
  OutputDirectory() = default;
  ~OutputDirectory();
  OutputDirectory(const OutputDirectory&) = delete;
  OutputDirectory& operator=(const OutputDirectory&) = delete;

  /// @param final_path  Replaced at Commit() if it is an empty directory or holds a file named
  /// `marker`,
  ///                    hence an earlier result; anything else there is refused with
  ///                    kExitCannotCreate.
  Outcome Open(const std::string& final_path, const std::string& marker);

  /// Where to write until Commit().
  const std::string& path() const { return temporary_path_; }

  /// Writes a file into the directory. `name` may not hold a slash.
  Outcome Write(const std::string& name, const std::string& bytes);

  Outcome Commit();

 private:
  std::string final_path_;
  std::string temporary_path_;  // empty when there is nothing to remove
};

}  // namespace plumb::tools
