// The sub-commands; each lives in the file of its name and declares its own options.
#pragma once

#include "tools/plumbline/program.h"

namespace plumb::tools {

void AddBenchFrame(CLI::App& bench, PendingRun& pending);
void AddBenchNet(CLI::App& bench, PendingRun& pending);
void AddBenchRefine(CLI::App& bench, PendingRun& pending);
void AddDetect(CLI::App& program, PendingRun& pending);
void AddDeviceList(CLI::App& device, PendingRun& pending);
void AddEvalAblation(CLI::App& eval, PendingRun& pending);
void AddEvalControls(CLI::App& eval, PendingRun& pending);
void AddEvalLines(CLI::App& eval, PendingRun& pending);
void AddEvalRepeatability(CLI::App& eval, PendingRun& pending);
void AddEvalTrajectory(CLI::App& eval, PendingRun& pending);
void AddMapBuild(CLI::App& map, PendingRun& pending);
void AddMapExport(CLI::App& map, PendingRun& pending);
void AddMapInfo(CLI::App& map, PendingRun& pending);
void AddReplay(CLI::App& program, PendingRun& pending);
void AddSynth(CLI::App& program, PendingRun& pending);
void AddVersion(CLI::App& program, PendingRun& pending);

}  // namespace plumb::tools
