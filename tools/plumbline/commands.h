// The sub-commands; each lives in the file of its name and declares its own options.
#pragma once

#include "tools/plumbline/program.h"

namespace plumb::tools {

void AddDetect(CLI::App& program, PendingRun& pending);
void AddEvalLines(CLI::App& eval, PendingRun& pending);
void AddEvalTrajectory(CLI::App& eval, PendingRun& pending);
void AddSynth(CLI::App& program, PendingRun& pending);
void AddVersion(CLI::App& program, PendingRun& pending);

}  // namespace plumb::tools
