#include "plumb/map/map_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "plumb/base/file.h"
#include "plumb/map/map_check.h"
#include "plumb/map/map_manifest.h"
#include "plumb/map/map_tiles.h"

namespace plumb {
namespace {

constexpr const char* kTilesName = "tiles";
constexpr std::string_view kTileEnding = ".plt";
constexpr size_t kMaxManifestBytes = 64 << 10;

/// Inside a map everything is the map's own fault, a missing file too.
Error AsCorrupt(Error error) {
  if (error.code == ErrorCode::kNotFound) error.code = ErrorCode::kCorruptData;
  return error;
}

std::string Inside(const std::string& directory, std::string_view name) {
  std::string path = directory;
  path += '/';
  path += name;
  return path;
}

Result<std::vector<std::string>> NamesIn(const std::string& directory) {
  std::vector<std::string> names;
  std::error_code code;
  std::filesystem::directory_iterator entry(directory, code), end;
  for (; !code && entry != end; entry.increment(code)) {
    names.push_back(entry->path().filename().string());
  }
  if (code) return SystemError(code.value(), "list", directory);
  return names;
}

/// True when removing `directory` as a map loses nothing else.
bool HoldsOnlyMap(const std::string& directory) {
  const auto names = NamesIn(directory);
  if (!names) return false;
  bool has_tiles = false;
  for (const std::string& name : *names) {
    has_tiles |= name == kTilesName;
    if (name != kTilesName && !IsMapFile(name)) return false;
  }
  if (!has_tiles) return true;
  const auto tiles = NamesIn(Inside(directory, kTilesName));
  return tiles && std::all_of(tiles->begin(), tiles->end(), [](const std::string& name) {
           return IsMapFile(Inside(kTilesName, name));
         });
}

/// Removes a directory that HoldsOnlyMap(); whatever else is in it stays.
void RemoveMap(const std::string& directory) {
  const std::string tiles = Inside(directory, kTilesName);
  if (const auto names = NamesIn(tiles)) {
    for (const std::string& name : *names) {
      if (IsMapFile(Inside(kTilesName, name))) unlink(Inside(tiles, name).c_str());
    }
  }
  rmdir(tiles.c_str());
  unlink(Inside(directory, kMapManifestName).c_str());
  rmdir(directory.c_str());
}

Status WriteFiles(const std::string& directory, const MapManifest& manifest,
                  const MapTiles& tiles) {
  const std::string tiles_path = Inside(directory, kTilesName);
  if (mkdir(tiles_path.c_str(), 0777) != 0) return SystemError(errno, "create", tiles_path);
  const Result<FileDescriptor> map_fd = OpenDirectory(directory);
  if (!map_fd) return map_fd.error();
  const Result<FileDescriptor> tiles_fd = OpenDirectoryAt(*map_fd, kTilesName, tiles_path);
  if (!tiles_fd) return tiles_fd.error();
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    const std::string& name = manifest.tiles[i].file;
    if (Status status = WriteNewFileAt(*tiles_fd, name, tiles[i], Inside(tiles_path, name));
        !status) {
      return status;
    }
  }
  if (Status status = SyncDirectory(*tiles_fd, tiles_path); !status) return status;
  if (Status status = WriteNewFileAt(*map_fd, kMapManifestName, WriteManifest(manifest),
                                     Inside(directory, kMapManifestName));
      !status) {
    return status;
  }
  return SyncDirectory(*map_fd, directory);
}

/// Moves `temporary` to `target`. Where a map is to be replaced the two change places, so that
/// there is no moment without a map; the old one is then called `temporary`.
Status Publish(const std::string& temporary, const std::string& target, bool overwrite) {
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) == 0) {
    return Ok();
  }
  const auto cannot_replace = [&](const char* why) {
    return Error{ErrorCode::kInvalidArgument, target + " exists" + why};
  };
  if (errno == EEXIST && !overwrite) return cannot_replace("");
  if (errno == EEXIST) {
    if (!HoldsOnlyMap(target)) return cannot_replace(" and is not a map, so it is not replaced");
    if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) {
      return Ok();
    }
  }
  if (errno != EINVAL && errno != ENOSYS) return SystemError(errno, "create", target);

  // A file system without these operations: there is a moment without a map.
  struct stat info = {};
  if (lstat(target.c_str(), &info) != 0) {
    if (errno == ENOENT && rename(temporary.c_str(), target.c_str()) == 0) return Ok();
    return SystemError(errno, "create", target);
  }
  if (!overwrite) return cannot_replace("");
  if (!HoldsOnlyMap(target)) return cannot_replace(" and is not a map, so it is not replaced");
  const std::string old = TemporaryName(target);
  if (rename(target.c_str(), old.c_str()) != 0) return SystemError(errno, "replace", target);
  if (rename(temporary.c_str(), target.c_str()) != 0) {
    const int code = errno;
    rename(old.c_str(), target.c_str());
    return SystemError(code, "create", target);
  }
  RemoveMap(old);
  return Ok();
}

Result<MapTiles> ReadTiles(const FileDescriptor& map_fd, const MapManifest& manifest,
                           const std::string& directory) {
  const std::string tiles_path = Inside(directory, kTilesName);
  const Result<FileDescriptor> tiles_fd = OpenDirectoryAt(map_fd, kTilesName, tiles_path);
  if (!tiles_fd) return AsCorrupt(tiles_fd.error());
  MapTiles tiles;
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    const TileEntry& entry = manifest.tiles[i];
    const std::string path = Inside(tiles_path, entry.file);
    Result<std::string> content = ReadFileAt(*tiles_fd, entry.file, entry.bytes, path);
    if (!content) return AsCorrupt(content.error());
    if (content->size() != entry.bytes || Checksum(*content) != entry.xxh3) {
      return Error{ErrorCode::kCorruptData, path + " does not match its checksum"};
    }
    tiles[i] = *std::move(content);
  }
  return tiles;
}

}  // namespace

bool IsMapFile(std::string_view name) {
  if (name == kMapManifestName) return true;
  const std::string folder = std::string(kTilesName) + "/";
  if (!name.starts_with(folder)) return false;
  name.remove_prefix(folder.size());
  return name.empty() || (name.ends_with(kTileEnding) && name.find('/') == name.npos);
}

Status WriteMap(const LineMap& map, const std::string& directory, const WriteMapOptions& options) {
  if (Status status = CheckMap(map); !status) return status;
  const Eigen::Vector3d origin = ChooseOrigin(map);
  const MapTiles tiles = EncodeTiles(map, origin);
  // Rounding to float can take the length of a segment away; what a reader would refuse must not
  // be written.
  Result<LineMap> decoded = DecodeTiles(tiles, origin);
  if (!decoded) return decoded.error();
  decoded->covariance_factor = map.covariance_factor;
  decoded->covariance_growth = map.covariance_growth;
  decoded->pose_change = map.pose_change;
  decoded->camera_correction = map.camera_correction;
  if (Status status = CheckMap(*decoded); !status) return status;

  MapManifest manifest = DescribeTiles(tiles);
  manifest.detector = map.detector;
  manifest.depth_source = map.depth_source;
  manifest.covariance_factor = map.covariance_factor;
  manifest.covariance_growth = map.covariance_growth;
  manifest.pose_change = map.pose_change;
  manifest.camera_correction = map.camera_correction;
  manifest.origin = origin;

  const size_t end = directory.find_last_not_of('/');
  if (end == std::string::npos) {
    return Error{ErrorCode::kInvalidArgument, "The map's directory has no name"};
  }
  const std::string target = directory.substr(0, end + 1);
  const std::string parent = ParentDirectory(target);
  const Result<FileDescriptor> parent_fd = OpenDirectory(parent);
  if (!parent_fd) return parent_fd.error();
  std::string temporary = TemporaryName(target);
  while (mkdir(temporary.c_str(), 0777) != 0) {
    if (errno != EEXIST) return SystemError(errno, "create", target);
    temporary = TemporaryName(target);
  }
  Status status = WriteFiles(temporary, manifest, tiles);
  if (status) status = Publish(temporary, target, options.overwrite);
  RemoveMap(temporary);  // a part after a failure, else the map that was replaced, or nothing
  if (!status) return status;
  return SyncDirectory(*parent_fd, parent);
}

Result<LineMap> ReadMap(const std::string& directory) {
  const Result<FileDescriptor> map_fd = OpenDirectory(directory);
  if (!map_fd) return map_fd.error();
  const std::string manifest_path = Inside(directory, kMapManifestName);
  const Result<std::string> text =
      ReadFileAt(*map_fd, kMapManifestName, kMaxManifestBytes, manifest_path);
  if (!text) return text.error();
  const auto in_file = [&](Error error) {
    error.message = directory + ": " + error.message;
    return error;
  };
  const Result<MapManifest> manifest = ParseManifest(*text);
  if (!manifest) return in_file(manifest.error());
  const Result<MapTiles> tiles = ReadTiles(*map_fd, *manifest, directory);
  if (!tiles) return tiles.error();
  Result<LineMap> map = DecodeTiles(*tiles, manifest->origin);
  if (!map) return in_file(map.error());
  map->detector = manifest->detector;
  map->depth_source = manifest->depth_source;
  map->covariance_factor = manifest->covariance_factor;
  map->covariance_growth = manifest->covariance_growth;
  map->pose_change = manifest->pose_change;
  map->camera_correction = manifest->camera_correction;
  if (const Status status = CheckMap(*map); !status) {
    return in_file({ErrorCode::kCorruptData, status.error().message});
  }
  return map;
}

}  // namespace plumb
