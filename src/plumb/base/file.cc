#include "plumb/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <system_error>

namespace plumb {
namespace {

/// open(2) that survives signals; -1 with errno on failure.
int OpenAt(int directory, const char* name, int flags, mode_t mode = 0) {
  int fd = -1;
  do {
    fd = openat(directory, name, flags | O_CLOEXEC, mode);
  } while (fd < 0 && errno == EINTR);
  return fd;
}

Status WriteAll(int fd, std::string_view content, const std::string& path) {
  while (!content.empty()) {
    const ssize_t count = write(fd, content.data(), content.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return SystemError(errno, "write", path);
    content.remove_prefix(static_cast<size_t>(count));
  }
  return Ok();
}

Status WriteAndFlush(int fd, std::string_view content, const std::string& path) {
  if (Status status = WriteAll(fd, content, path); !status) return status;
  if (fsync(fd) != 0) return SystemError(errno, "flush", path);
  return Ok();
}

/// Where the links at the end of `path` lead, the last file of which need not exist.
/// @param is_open  Whether it is a file that a process holds open (/dev/stdout): there, it stays.
Result<std::string> FollowLinks(std::string path, bool* is_open) {
  constexpr int kMaxLinks = 40;  // as the system has it
  for (int i = 0; i < kMaxLinks; ++i) {
    *is_open = path.starts_with("/proc/") || path.starts_with("/dev/fd/");
    if (*is_open) return path;
    std::array<char, PATH_MAX> target = {};
    const ssize_t size = readlink(path.c_str(), target.data(), target.size());
    if (size < 0) return path;  // no link
    const std::string next(target.data(), static_cast<size_t>(size));
    path = next.starts_with('/') ? next : ParentDirectory(path) + "/" + next;
  }
  return SystemError(ELOOP, "follow the links of", path);
}

/// Devices, pipes and what is open are not replaced, they are written to, a file at its end; many
/// of them cannot be flushed.
Status WriteThrough(const std::string& path, std::string_view content) {
  const FileDescriptor file(OpenAt(AT_FDCWD, path.c_str(), O_WRONLY | O_NOCTTY | O_APPEND));
  if (file.get() < 0) return SystemError(errno, "open", path);
  return WriteAll(file.get(), content, path);
}

Result<std::string> ReadAll(int fd, size_t max_bytes, const std::string& path) {
  struct stat info = {};
  if (fstat(fd, &info) != 0) return SystemError(errno, "examine", path);
  if (!S_ISREG(info.st_mode)) return Error{ErrorCode::kCorruptData, path + " is not a plain file"};
  if (static_cast<size_t>(info.st_size) > max_bytes) {
    return Error{ErrorCode::kCorruptData, path + " has " + std::to_string(info.st_size) +
                                              " bytes, more than " + std::to_string(max_bytes)};
  }
  std::string content(static_cast<size_t>(info.st_size), '\0');
  size_t size = 0;
  while (size < content.size()) {
    const ssize_t count = read(fd, content.data() + size, content.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return SystemError(errno, "read", path);
    if (count == 0) break;  // the file was cut while it was read
    size += static_cast<size_t>(count);
  }
  content.resize(size);
  return content;
}

}  // namespace

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) close(fd_);
}

Error SystemError(int code, std::string_view action, std::string_view path) {
  const bool is_missing = code == ENOENT || code == ENOTDIR;
  const bool is_link = code == ELOOP;
  return {
      is_missing ? ErrorCode::kNotFound : (is_link ? ErrorCode::kCorruptData : ErrorCode::kIoError),
      "Cannot " + std::string(action) + " " + std::string(path) + ": " +
          std::generic_category().message(code)};
}

Result<FileDescriptor> OpenDirectoryAt(const FileDescriptor& parent, const std::string& name,
                                       const std::string& path) {
  const int fd = OpenAt(parent.get(), name.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW);
  if (fd < 0) return SystemError(errno, "open directory", path);
  return FileDescriptor(fd);
}

Result<FileDescriptor> OpenDirectory(const std::string& path) {
  const int fd = OpenAt(AT_FDCWD, path.c_str(), O_RDONLY | O_DIRECTORY);
  if (fd < 0) return SystemError(errno, "open directory", path);
  return FileDescriptor(fd);
}

Result<std::string> ReadFileAt(const FileDescriptor& directory, const std::string& name,
                               size_t max_bytes, const std::string& path) {
  // Without O_NONBLOCK a named pipe would block for ever.
  const FileDescriptor file(
      OpenAt(directory.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK));
  if (file.get() < 0) return SystemError(errno, "open", path);
  return ReadAll(file.get(), max_bytes, path);
}

Result<std::string> ReadFile(const std::string& path, size_t max_bytes) {
  const FileDescriptor file(OpenAt(AT_FDCWD, path.c_str(), O_RDONLY | O_NONBLOCK));
  if (file.get() < 0) return SystemError(errno, "open", path);
  return ReadAll(file.get(), max_bytes, path);
}

Status WriteNewFileAt(const FileDescriptor& directory, const std::string& name,
                      std::string_view content, const std::string& path) {
  const FileDescriptor file(
      OpenAt(directory.get(), name.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0666));
  if (file.get() < 0) return SystemError(errno, "create", path);
  return WriteAndFlush(file.get(), content, path);
}

Status SyncDirectory(const FileDescriptor& directory, const std::string& path) {
  // Some file systems cannot flush directories and say so with EINVAL.
  if (fsync(directory.get()) != 0 && errno != EINVAL) return SystemError(errno, "flush", path);
  return Ok();
}

std::string TemporaryName(const std::string& path) {
  static std::atomic<uint64_t> counter{0};
  return path.substr(0, path.find_last_not_of('/') + 1) + ".tmp-" + std::to_string(getpid()) + "-" +
         std::to_string(counter.fetch_add(1));
}

Status WriteFileAtomically(const std::string& given_path, std::string_view content) {
  struct stat info = {};
  if (stat(given_path.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    return WriteThrough(given_path, content);
  }
  bool is_open = false;
  const Result<std::string> followed = FollowLinks(given_path, &is_open);
  if (!followed) return followed.error();
  if (is_open) return WriteThrough(given_path, content);
  const std::string& path = *followed;
  const std::string parent = ParentDirectory(path);
  Result<FileDescriptor> directory = OpenDirectory(parent);
  if (!directory) return directory.error();
  std::string temporary;
  FileDescriptor file;
  do {
    temporary = TemporaryName(path);
    file = FileDescriptor(OpenAt(AT_FDCWD, temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0666));
  } while (file.get() < 0 && errno == EEXIST);
  if (file.get() < 0) return SystemError(errno, "create", path);
  Status status = WriteAndFlush(file.get(), content, path);
  if (status && rename(temporary.c_str(), path.c_str()) != 0) {
    status = SystemError(errno, "create", path);
  }
  if (!status) {
    unlink(temporary.c_str());
    return status;
  }
  return SyncDirectory(*directory, parent);
}

std::string ParentDirectory(const std::string& path) {
  const size_t end = path.find_last_not_of('/');
  if (end == std::string::npos) return path.empty() ? "." : "/";
  const size_t slash = path.find_last_of('/', end);
  if (slash == std::string::npos) return ".";
  const size_t last = path.find_last_not_of('/', slash);
  return last == std::string::npos ? "/" : path.substr(0, last + 1);
}

}  // namespace plumb
