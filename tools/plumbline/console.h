// What the program says: data on stdout, remarks and progress on stderr.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace plumb::tools {

/// Writes `text` to stdout. @return false if it could not be written (a full disk, a closed pipe).
bool PrintData(std::string_view text);

/// Writes one remark line to stderr.
void PrintRemark(std::string_view text);

/// A progress bar on stderr for work of known length. It draws only if stderr is a terminal, at
/// most ten times a second, and wipes itself at the end.
class ProgressBar {
 public:
  ProgressBar(std::string label, size_t num_steps);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void Advance();

 private:
  std::string label_;
  size_t num_steps_;
  size_t num_done_ = 0;
  bool visible_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_draw_;
};

}  // namespace plumb::tools
