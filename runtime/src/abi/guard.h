// What stands between the library and its host: nothing unwinds, every error has a text.
#pragma once

#include <exception>
#include <new>
#include <string>

#include "plumb/base/result.h"
#include "plumbline/plumbline.h"

namespace plumb::abi {

/// Text of plumb_last_error() for this thread.
const char* LastError() noexcept;

/// Remembers `message` for LastError() and returns `result`.
plumb_result Fail(plumb_result result, const char* message) noexcept;
plumb_result Fail(const Error& error) noexcept;

/// Every entry point that returns a result runs its body in here.
template <typename Fn>
plumb_result Guard(Fn&& fn) noexcept {
  try {
    return fn();
  } catch (const std::bad_alloc&) {
    return Fail(PLUMB_ERROR_OUT_OF_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return Fail(PLUMB_ERROR_INTERNAL, e.what());
  } catch (...) {
    return Fail(PLUMB_ERROR_INTERNAL, "unknown exception");
  }
}

/// The result code of an error code.
plumb_result ToAbi(ErrorCode code);

}  // namespace plumb::abi
