// Ctrl-C: the frame at hand is finished, what was begun is removed, then the program ends.
#include "tools/plumbline/interrupt.h"

#include <csignal>

namespace plumb::tools {
namespace {

volatile std::sig_atomic_t noted_signal = 0;

extern "C" void NoteSignal(int signal) { noted_signal = signal; }

}  // namespace

void NoteInterrupts() {
  struct sigaction action = {};
  action.sa_handler = NoteSignal;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

Outcome CheckInterrupt() {
  if (noted_signal == 0) return std::nullopt;
  return Failure{noted_signal == SIGINT ? kExitInterrupted : kExitTerminated,
                 "interrupted, nothing was written"};
}

}  // namespace plumb::tools
