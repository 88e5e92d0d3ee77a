#include "plumb/base/log.h"

#include <mutex>

namespace plumb {
namespace {

struct Target {
  LogSink sink = nullptr;
  void* user = nullptr;
  LogLevel min_level = LogLevel::kWarning;
};

std::mutex target_mutex;
Target target;

}  // namespace

void SetLogSink(LogSink sink, void* user, LogLevel min_level) {
  const std::scoped_lock lock(target_mutex);
  target = {sink, user, min_level};
}

void Log(LogLevel level, const std::string& message) {
  Target current;
  {
    const std::scoped_lock lock(target_mutex);
    current = target;
  }
  if (current.sink != nullptr && level >= current.min_level) {
    current.sink(level, message.c_str(), current.user);
  }
}

}  // namespace plumb
