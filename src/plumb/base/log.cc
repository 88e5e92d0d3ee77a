#include "plumb/base/log.h"

#include <memory>
#include <mutex>
#include <utility>

namespace plumb {
namespace {

struct Target {
  LogSink sink;
  LogLevel min_level;
};

std::mutex target_mutex;
std::shared_ptr<const Target> target;  // null: nobody listens

}  // namespace

void SetLogSink(LogSink sink, LogLevel min_level) {
  std::shared_ptr<const Target> next;
  if (sink) next = std::make_shared<const Target>(Target{std::move(sink), min_level});
  {
    const std::scoped_lock lock(target_mutex);
    std::swap(target, next);
  }
  // The former target ends here or with its last call, without the lock.
}

void Log(LogLevel level, const std::string& message) {
  std::shared_ptr<const Target> current;
  {
    const std::scoped_lock lock(target_mutex);
    current = target;
  }
  if (current != nullptr && level >= current->min_level) current->sink(level, message.c_str());
}

}  // namespace plumb
