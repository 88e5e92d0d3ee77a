// Ctrl-C: the frame at hand is finished, what was begun is removed, then the program ends.
#pragma once

#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// From now on the first SIGINT or SIGTERM is only noted; a second one ends the program at once.
void NoteInterrupts();

/// To be called between the frames of long work.
/// @return kExitInterrupted or kExitTerminated after such a signal.
Outcome CheckInterrupt();

}  // namespace plumb::tools
