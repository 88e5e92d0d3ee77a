// Where the library's messages go: nowhere, until the host asks for them.
#pragma once

#include <functional>
#include <string>

namespace plumb {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

/// Called by any thread, possibly by several at once, never with a lock of the library held.
/// `message` is one sentence without a trailing newline, valid during the call. Must not throw.
using LogSink = std::function<void(LogLevel level, const char* message)>;

/// Sends messages of `min_level` and above to `sink`; an empty one drops them all, which is the
/// default. A call of the former sink that another thread began before may still be running on
/// return. Thread-safe.
void SetLogSink(LogSink sink, LogLevel min_level);

/// Hands `message` to the sink, if it wants it. Thread-safe. Not for the frame path.
void Log(LogLevel level, const std::string& message);

}  // namespace plumb
