#include "plumb/refine/quiet_ceres.h"

#include <mutex>

#include <glog/logging.h>

namespace plumb {

void QuietCeres() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (!google::IsGoogleLoggingInitialized()) FLAGS_minloglevel = google::GLOG_FATAL;
  });
}

}  // namespace plumb
