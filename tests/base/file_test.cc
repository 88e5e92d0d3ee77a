#include "plumb/base/file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "support/temporary_directory.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Slurp;
using testing::Spill;
using testing::TemporaryDirectory;

TEST(ReadFile, ReturnsEveryByte) {
  const TemporaryDirectory root;
  std::string content(100'000, '\0');
  for (size_t i = 0; i < content.size(); ++i) content[i] = static_cast<char>(i * 7);
  Spill(root / "file", content);
  const Result<std::string> read = ReadFile(root / "file", content.size());
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, content);
}

TEST(ReadFile, RefusesOneByteMoreThanAllowed) {
  const TemporaryDirectory root;
  Spill(root / "file", "12345");
  EXPECT_TRUE(ReadFile(root / "file", 5));
  const Result<std::string> read = ReadFile(root / "file", 4);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(read.error().message, HasSubstr("5 bytes"));
}

TEST(ReadFile, NamesTheFileThatIsMissing) {
  const Result<std::string> read = ReadFile("/nowhere/at/all", 10);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(read.error().message, HasSubstr("/nowhere/at/all"));
}

TEST(ReadFile, RefusesDirectoriesAndPipes) {
  const TemporaryDirectory root;
  EXPECT_EQ(ReadFile(root.path(), 10).error().code, ErrorCode::kCorruptData);
  ASSERT_EQ(mkfifo((root / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(ReadFile(root / "pipe", 10).error().code, ErrorCode::kCorruptData);
}

TEST(ReadFileAt, DoesNotFollowALink) {
  const TemporaryDirectory root;
  Spill(root / "file", "text");
  std::filesystem::create_symlink("file", root / "link");
  const Result<FileDescriptor> directory = OpenDirectory(root.path());
  ASSERT_TRUE(directory);
  EXPECT_TRUE(ReadFileAt(*directory, "file", 10, "file"));
  EXPECT_EQ(ReadFileAt(*directory, "link", 10, "link").error().code, ErrorCode::kCorruptData);
  EXPECT_TRUE(ReadFile(root / "link", 10)) << "A path given by the user may be a link.";
}

TEST(WriteNewFileAt, NeverWritesOverAFile) {
  const TemporaryDirectory root;
  const Result<FileDescriptor> directory = OpenDirectory(root.path());
  ASSERT_TRUE(directory);
  EXPECT_TRUE(WriteNewFileAt(*directory, "file", "first", "file"));
  EXPECT_FALSE(WriteNewFileAt(*directory, "file", "second", "file"));
  EXPECT_EQ(Slurp(root / "file"), "first");
}

TEST(WriteFileAtomically, ReplacesTheContentAndLeavesNoOtherFile) {
  const TemporaryDirectory root;
  ASSERT_TRUE(WriteFileAtomically(root / "file", "first, and long"));
  ASSERT_TRUE(WriteFileAtomically(root / "file", "second"));
  EXPECT_EQ(Slurp(root / "file"), "second");
  EXPECT_THAT(root.Names(), ElementsAre("file"));
}

TEST(WriteFileAtomically, KeepsAReaderOfTheOldFileUndisturbed) {
  const TemporaryDirectory root;
  ASSERT_TRUE(WriteFileAtomically(root / "file", "old content"));
  std::ifstream reader(root / "file");
  ASSERT_TRUE(WriteFileAtomically(root / "file", "new"));
  std::string line;
  std::getline(reader, line);
  EXPECT_EQ(line, "old content");
}

TEST(WriteFileAtomically, ObeysTheUsersFileMask) {
  const TemporaryDirectory root;
  const mode_t mask = umask(027);
  ASSERT_TRUE(WriteFileAtomically(root / "file", "text"));
  umask(mask);
  struct stat info = {};
  ASSERT_EQ(stat((root / "file").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0640u);
}

TEST(WriteFileAtomically, FailsWithoutTraceWhereTheTargetIsADirectory) {
  const TemporaryDirectory root;
  std::filesystem::create_directory(root / "target");
  EXPECT_EQ(WriteFileAtomically(root / "target", "x").error().code, ErrorCode::kIoError);
  EXPECT_EQ(WriteFileAtomically(root / "no/target", "x").error().code, ErrorCode::kNotFound);
  EXPECT_THAT(root.Names(), ElementsAre("target"));
}

TEST(WriteFileAtomically, ReplacesWhatALinkLeadsTo) {
  const TemporaryDirectory root;
  std::filesystem::create_directory(root / "disk");
  Spill(root / "disk/file", "old");
  std::filesystem::create_symlink("disk/file", root / "link");
  std::filesystem::create_symlink(root / "link", root / "link2");
  std::filesystem::create_symlink("disk/new", root / "dangling");
  for (const char* name : {"link", "link2", "dangling"}) {
    const Status written = WriteFileAtomically(root / name, name);
    ASSERT_TRUE(written) << written.error().message;
    EXPECT_TRUE(std::filesystem::is_symlink(root / name));
    EXPECT_EQ(Slurp(root / name), name);
  }
  EXPECT_EQ(Slurp(root / "disk/file"), "link2");
  EXPECT_EQ(Slurp(root / "disk/new"), "dangling");
  std::filesystem::create_symlink("loop", root / "loop");
  EXPECT_EQ(WriteFileAtomically(root / "loop", "x").error().code, ErrorCode::kCorruptData);
}

TEST(WriteFileAtomically, WritesToTheEndOfWhatIsOpen) {
  const TemporaryDirectory root;
  Spill(root / "out", "before,");
  const int open_file = open((root / "out").c_str(), O_WRONLY | O_APPEND);
  ASSERT_GE(open_file, 0);
  // As /dev/stdout leads there.
  std::filesystem::create_symlink("/proc/self/fd/" + std::to_string(open_file), root / "link");
  ASSERT_TRUE(WriteFileAtomically(root / "link", "text,"));
  EXPECT_EQ(write(open_file, "after", 5), 5);
  close(open_file);
  EXPECT_EQ(Slurp(root / "out"), "before,text,after");
}

TEST(WriteFileAtomically, WritesIntoPipesAndDevices) {
  const TemporaryDirectory root;
  ASSERT_EQ(mkfifo((root / "pipe").c_str(), 0600), 0);
  const int reader = open((root / "pipe").c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  std::filesystem::create_symlink("pipe", root / "link");
  for (const char* name : {"pipe", "link"}) {
    const Status written = WriteFileAtomically(root / name, "text");
    ASSERT_TRUE(written) << written.error().message;
    char text[9] = {};
    EXPECT_EQ(read(reader, text, sizeof(text)), 4);
    EXPECT_STREQ(text, "text");
  }
  close(reader);
  std::filesystem::create_symlink("/dev/null", root / "null");
  EXPECT_TRUE(WriteFileAtomically(root / "null", "text"));
  EXPECT_TRUE(std::filesystem::is_symlink(root / "null"));
  EXPECT_TRUE(std::filesystem::is_fifo(root / "pipe"));
  EXPECT_EQ(root.Names().size(), 3u);
}

TEST(ParentDirectory, IsWhatHoldsTheLastName) {
  EXPECT_EQ(ParentDirectory("name"), ".");
  EXPECT_EQ(ParentDirectory("name/"), ".");
  EXPECT_EQ(ParentDirectory("a/name"), "a");
  EXPECT_EQ(ParentDirectory("/name"), "/");
  EXPECT_EQ(ParentDirectory("/a//name//"), "/a");
  EXPECT_EQ(ParentDirectory("/"), "/");
  EXPECT_EQ(ParentDirectory(""), ".");
}

TEST(TemporaryName, IsBesideThePathAndNeverTheSame) {
  std::set<std::string> names;
  for (int i = 0; i < 100; ++i) names.insert(TemporaryName("/a/b/"));
  EXPECT_EQ(names.size(), 100u);
  for (const std::string& name : names) EXPECT_EQ(ParentDirectory(name), "/a");
}

TEST(FileDescriptor, ClosesWhatItOwnsOnce) {
  const TemporaryDirectory root;
  int fd = -1;
  {
    Result<FileDescriptor> directory = OpenDirectory(root.path());
    ASSERT_TRUE(directory);
    FileDescriptor moved = *std::move(directory);
    fd = moved.get();
    EXPECT_GE(fd, 0);
  }
  struct stat info = {};
  EXPECT_NE(fstat(fd, &info), 0);
}

}  // namespace
}  // namespace plumb
