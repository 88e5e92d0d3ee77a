// What the program says: data on stdout, remarks and progress on stderr.
#include "tools/plumbline/console.h"

#include <cstdio>
#include <utility>

#include <unistd.h>

namespace plumb::tools {
namespace {

constexpr size_t kBarWidth = 30;
constexpr auto kRedrawInterval = std::chrono::milliseconds(100);

}  // namespace

bool PrintData(std::string_view text) {
  return std::fwrite(text.data(), 1, text.size(), stdout) == text.size() &&
         std::fflush(stdout) == 0;
}

void PrintRemark(std::string_view text) {
  std::fprintf(stderr, "plumbline: %.*s\n", static_cast<int>(text.size()), text.data());
}

ProgressBar::ProgressBar(std::string label, size_t num_steps)
    : label_(std::move(label)),
      num_steps_(num_steps),
      visible_(num_steps > 1 && isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      next_draw_(start_) {}

ProgressBar::~ProgressBar() {
  if (drawn_) std::fputs("\r\x1b[K", stderr);
}

void ProgressBar::Advance() {
  ++num_done_;
  if (!visible_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_draw_) return;
  next_draw_ = now + kRedrawInterval;
  const size_t filled = kBarWidth * num_done_ / num_steps_;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double left =
      seconds * static_cast<double>(num_steps_ - num_done_) / static_cast<double>(num_done_);
  std::fprintf(stderr, "\r%s [%s%s] %zu/%zu, %.0f s left\x1b[K", label_.c_str(),
               std::string(filled, '=').c_str(), std::string(kBarWidth - filled, ' ').c_str(),
               num_done_, num_steps_, left);
  std::fflush(stderr);
  drawn_ = true;
}

}  // namespace plumb::tools
