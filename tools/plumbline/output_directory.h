// Directories of results that appear complete or not at all.
#pragma once

#include <string>
#include <string_view>

#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// What a command writes: tells its earlier results from other people's files.
struct ResultFiles {
  const char* marker = "";  // a file that every result holds
  /// Whether a result may hold `name`, relative to its directory; folders end in a slash:
  /// "rgb/", "rgb/000001.jpg".
  bool (*holds)(std::string_view name) = nullptr;
};

/// Checks that a directory of results could take its place at `path`: its parent exists and can be
/// written, and nothing is there but an empty directory or an earlier result alone.
/// @return kExitCannotCreate otherwise, naming the first file that is no part of a result.
Outcome CheckReplaceable(const std::string& path, const ResultFiles& files);

/// `path` without what says nothing ("run/.", "run//"), a link at its end followed.
std::string PlainPath(const std::string& path);

/// Results are written into a temporary directory beside the final place; Commit() renames it. What
/// was not committed is removed with the object, so that an error leaves nothing behind.
class OutputDirectory {
 public:
  OutputDirectory() = default;
  ~OutputDirectory();
  OutputDirectory(const OutputDirectory&) = delete;
  OutputDirectory& operator=(const OutputDirectory&) = delete;

  /// @param final_path  Replaced at Commit() as CheckReplaceable() allows; anything else there is
  ///                    refused.
  Outcome Open(const std::string& final_path, const ResultFiles& files);

  /// Where to write until Commit().
  const std::string& path() const { return temporary_path_; }

  /// Writes a file into the directory. `name` may not hold a slash.
  Outcome Write(const std::string& name, const std::string& bytes);

  /// Refuses what CheckReplaceable() would by now; an earlier result is then as it was.
  Outcome Commit();

 private:
  ResultFiles files_;
  std::string final_path_;
  std::string temporary_path_;  // empty when there is nothing to remove
};

}  // namespace plumb::tools
