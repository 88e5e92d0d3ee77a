// Structs that callers of other versions hand over: struct_size first, members only appended.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

#include "plumb/base/result.h"

namespace plumb::abi {

/// Larger than any struct ever gets: an uninitialised size is caught before it is believed.
inline constexpr uint32_t kMaxStructBytes = 1u << 16;

/// Whether a struct may have this size. Every member's size is a multiple of four bytes: another
/// one ends inside of a member. (Not every such size ends between two.)
inline bool IsStructSize(uint32_t size, size_t size_v1) {
  return size >= size_v1 && size <= kMaxStructBytes && size % 4 == 0;
}

/// A struct of this library's version with what the caller set; members that an older caller does
/// not know are zero. `size_v1` is the size of the struct's first version.
/// @return kInvalidArgument when the struct is null or its size impossible; kUnsupported when a
///         member that this library does not know is not zero.
template <typename T>
Result<T> ReadStruct(const T* from, size_t size_v1, const char* name) {
  if (from == nullptr) {
    return Error{ErrorCode::kInvalidArgument, std::string(name) + " must not be NULL"};
  }
  const uint32_t size = from->struct_size;
  if (!IsStructSize(size, size_v1)) {
    return Error{ErrorCode::kInvalidArgument, std::string(name) + ".struct_size " +
                                                  std::to_string(size) + " is not the size of " +
                                                  name + " (" + std::to_string(sizeof(T)) + ")"};
  }
  const auto* bytes = reinterpret_cast<const unsigned char*>(from);
  for (size_t i = sizeof(T); i < size; ++i) {
    if (bytes[i] != 0) {
      return Error{ErrorCode::kUnsupported,
                   std::string(name) + " has members that this version does not know"};
    }
  }
  T copy{};
  std::memcpy(&copy, from, std::min<size_t>(size, sizeof(T)));
  return copy;
}

/// Checks a struct that WriteStruct() is going to fill.
template <typename T>
Status CheckOutput(const T* to, size_t size_v1, const char* name) {
  if (to == nullptr) {
    return Error{ErrorCode::kInvalidArgument, std::string(name) + " must not be NULL"};
  }
  if (!IsStructSize(to->struct_size, size_v1)) {
    return Error{ErrorCode::kInvalidArgument,
                 std::string(name) + ".struct_size " + std::to_string(to->struct_size) +
                     " is not the size of " + name + " (" + std::to_string(sizeof(T)) + ")"};
  }
  return Ok();
}

/// Gives the caller as much of `from` as it knows; what only the caller knows becomes zero.
template <typename T>
void WriteStruct(const T& from, T* to) {
  const uint32_t size = to->struct_size;
  std::memcpy(to, &from, std::min<size_t>(size, sizeof(T)));
  if (size > sizeof(T)) std::memset(reinterpret_cast<char*>(to) + sizeof(T), 0, size - sizeof(T));
  to->struct_size = size;
}

}  // namespace plumb::abi
