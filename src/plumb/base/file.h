// Files that are read whole, and files that appear complete or not at all.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "plumb/base/result.h"

namespace plumb {

/// Owns a POSIX file descriptor.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileDescriptor();

  int get() const { return fd_; }

 private:
  int fd_ = -1;
};

/// The error for `errno` = `code` after `action` on `path`: "Cannot open a/b: No such file".
Error SystemError(int code, std::string_view action, std::string_view path);

/// Opens the directory `name` inside `parent` without following a link. `path` is for messages.
Result<FileDescriptor> OpenDirectoryAt(const FileDescriptor& parent, const std::string& name,
                                       const std::string& path);

/// Opens the directory `path`; links are followed.
Result<FileDescriptor> OpenDirectory(const std::string& path);

/// Reads the regular file `name` inside `directory` whole. `path` is for messages.
/// @return kNotFound when it does not exist; kCorruptData when it is a link, a device or a
///         directory, or larger than `max_bytes` (found before memory is allocated).
Result<std::string> ReadFileAt(const FileDescriptor& directory, const std::string& name,
                               size_t max_bytes, const std::string& path);

/// Reads the regular file `path` whole; links are followed. Errors as ReadFileAt().
Result<std::string> ReadFile(const std::string& path, size_t max_bytes);

/// Creates `name` inside `directory`, which must not hold it, and flushes it to the disk.
Status WriteNewFileAt(const FileDescriptor& directory, const std::string& name,
                      std::string_view content, const std::string& path);

/// Flushes a directory's entries to the disk.
Status SyncDirectory(const FileDescriptor& directory, const std::string& path);

/// Replaces `path` by a file with `content`: a temporary file beside it is flushed and renamed, so
/// that a reader sees the old content or the new one, and a failure leaves nothing behind. Of a
/// link, the file that it leads to is replaced. Into a device or a pipe `content` is written as it
/// is, and to the end of a file that is open by the name of /dev/stdout.
Status WriteFileAtomically(const std::string& path, std::string_view content);

/// A name beside `path` that no other call of this process returns.
std::string TemporaryName(const std::string& path);

/// The directory that holds `path`, "." for a bare name.
std::string ParentDirectory(const std::string& path);

}  // namespace plumb
