// Keeps Ceres from printing.
#pragma once

namespace plumb {

/// Ceres logs through glog, which prints to stderr until a program initialises it. Unless the host
/// has done so, raises glog's level to fatal messages, once; a host that initialised glog decides
/// itself where they go, and none of its settings are touched. Thread-safe.
void QuietCeres();

}  // namespace plumb
