// Results appear complete or not at all, also when the program is interrupted.
#include "tools/plumbline/output_directory.h"

#include <csignal>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/temporary_directory.h"
#include "tools/plumbline/interrupt.h"

namespace plumb::tools {
namespace {

using ::testing::HasSubstr;
using testing::ReadAll;
using testing::TemporaryDirectory;

bool IsResultFile(std::string_view name) {
  return name == "marker" || name == "part" || name == "folder/" || name == "folder/part";
}
constexpr ResultFiles kFiles = {"marker", IsResultFile};

TEST(OutputDirectory, AppearsAtCommitOnly) {
  const TemporaryDirectory dir;
  OutputDirectory out;
  ASSERT_FALSE(out.Open(dir / "run/", kFiles));
  ASSERT_FALSE(out.Write("marker", "1"));
  EXPECT_FALSE(std::filesystem::exists(dir / "run"));
  ASSERT_FALSE(out.Commit());
  EXPECT_EQ(ReadAll(dir / "run/marker"), "1");
}

TEST(OutputDirectory, LeavesNothingWhenNotCommitted) {
  const TemporaryDirectory dir;
  {
    OutputDirectory out;
    ASSERT_FALSE(out.Open(dir / "run", kFiles));
    ASSERT_FALSE(out.Write("marker", "1"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(OutputDirectory, ReplacesAnEarlierResultAsAWhole) {
  const TemporaryDirectory dir;
  dir.Write("run/marker", "old");
  dir.Write("run/folder/part", "old");
  OutputDirectory out;
  ASSERT_FALSE(out.Open(dir / "run", kFiles));
  ASSERT_FALSE(out.Write("marker", "new"));
  EXPECT_EQ(ReadAll(dir / "run/marker"), "old");
  ASSERT_FALSE(out.Commit());
  EXPECT_EQ(ReadAll(dir / "run/marker"), "new");
  EXPECT_FALSE(std::filesystem::exists(dir / "run/folder"));
}

TEST(OutputDirectory, RefusesWhatIsNoEarlierResult) {
  const TemporaryDirectory dir;
  dir.Write("run/letter", "dear");
  dir.Write("file", "text");
  std::filesystem::create_directory(dir / "empty");
  EXPECT_EQ(CheckReplaceable(dir / "run", kFiles)->code, kExitCannotCreate);
  EXPECT_EQ(CheckReplaceable(dir / "file", kFiles)->code, kExitCannotCreate);
  EXPECT_THAT(CheckReplaceable(dir / "no/run", kFiles)->message, HasSubstr("no directory"));
  EXPECT_FALSE(CheckReplaceable(dir / "empty", kFiles));
  EXPECT_FALSE(CheckReplaceable(dir / "new", kFiles));
}

TEST(OutputDirectory, RefusesAResultThatHoldsSomethingElseToo) {
  for (const char* name : {"letter", "folder/letter", "other/part", "folder/part.txt"}) {
    const TemporaryDirectory dir;
    dir.Write("run/marker", "old");
    const std::string foreign = dir.Write(std::string("run/") + name, "dear");
    const Outcome refused = CheckReplaceable(dir / "run", kFiles);
    ASSERT_TRUE(refused) << name;
    EXPECT_EQ(refused->code, kExitCannotCreate);
    const std::string top = std::string(name).starts_with("other/") ? "other/" : name;
    EXPECT_THAT(refused->message, HasSubstr("holds " + top + ", which"));
    OutputDirectory out;
    EXPECT_TRUE(out.Open(dir / "run", kFiles));
    EXPECT_EQ(ReadAll(foreign), "dear");
  }
}

TEST(OutputDirectory, KeepsWhatOthersPutThereMeanwhile) {
  const TemporaryDirectory dir;
  dir.Write("run/marker", "old");
  {
    OutputDirectory out;
    ASSERT_FALSE(out.Open(dir / "run", kFiles));
    ASSERT_FALSE(out.Write("marker", "new"));
    dir.Write("run/letter", "dear");
    const Outcome refused = out.Commit();
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->code, kExitCannotCreate);
  }
  EXPECT_EQ(ReadAll(dir / "run/letter"), "dear");
  EXPECT_EQ(ReadAll(dir / "run/marker"), "old");
}

TEST(OutputDirectory, NamesWithoutMeaningAreLeftOut) {
  const TemporaryDirectory dir;
  for (const char* name : {"run", "run/.", "run//", "./run/../run/./"}) {
    OutputDirectory out;
    ASSERT_FALSE(out.Open(dir / name, kFiles)) << name;
    ASSERT_FALSE(out.Write("marker", name));
    ASSERT_FALSE(out.Commit()) << name;
    EXPECT_EQ(ReadAll(dir / "run/marker"), name);
  }
  for (const char* name : {".", "..", "/", "", "run/.."}) {
    const Outcome refused = CheckReplaceable(name, kFiles);
    ASSERT_TRUE(refused) << name;
    EXPECT_EQ(refused->code, kExitCannotCreate);
    EXPECT_THAT(refused->message, HasSubstr("own name")) << name;
  }
}

TEST(OutputDirectory, FollowsALinkAndKeepsIt) {
  const TemporaryDirectory dir;
  dir.Write("disk/run/marker", "old");
  std::filesystem::create_symlink(dir / "disk/run", dir / "link");
  std::filesystem::create_symlink(dir / "nowhere", dir / "dangling");
  OutputDirectory out;
  ASSERT_FALSE(out.Open(dir / "link", kFiles));
  ASSERT_FALSE(out.Write("marker", "new"));
  ASSERT_FALSE(out.Commit());
  EXPECT_TRUE(std::filesystem::is_symlink(dir / "link"));
  // As the system has it, ".." is where the link leads.
  OutputDirectory beside;
  ASSERT_FALSE(beside.Open(dir / "link/../other", kFiles));
  ASSERT_FALSE(beside.Write("marker", "beside"));
  ASSERT_FALSE(beside.Commit());
  EXPECT_EQ(ReadAll(dir / "disk/other/marker"), "beside");
  EXPECT_EQ(ReadAll(dir / "disk/run/marker"), "new");
  EXPECT_EQ(CheckReplaceable(dir / "dangling", kFiles)->code, kExitCannotCreate);
}

TEST(Interrupt, IsNotedAndHasTheShellsExitCode) {
  EXPECT_FALSE(CheckInterrupt());
  NoteInterrupts();
  std::raise(SIGINT);
  const Outcome interrupted = CheckInterrupt();
  ASSERT_TRUE(interrupted);
  EXPECT_EQ(interrupted->code, 130);
}

}  // namespace
}  // namespace plumb::tools
