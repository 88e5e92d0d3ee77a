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

TEST(OutputDirectory, AppearsAtCommitOnly) {
  const TemporaryDirectory dir;
  OutputDirectory out;
  ASSERT_FALSE(out.Open(dir / "run/", "marker"));
  ASSERT_FALSE(out.Write("marker", "1"));
  EXPECT_FALSE(std::filesystem::exists(dir / "run"));
  ASSERT_FALSE(out.Commit());
  EXPECT_EQ(ReadAll(dir / "run/marker"), "1");
}

TEST(OutputDirectory, LeavesNothingWhenNotCommitted) {
  const TemporaryDirectory dir;
  {
    OutputDirectory out;
    ASSERT_FALSE(out.Open(dir / "run", "marker"));
    ASSERT_FALSE(out.Write("marker", "1"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(OutputDirectory, ReplacesAnEarlierResultAsAWhole) {
  const TemporaryDirectory dir;
  dir.Write("run/marker", "old");
  dir.Write("run/leftover", "old");
  OutputDirectory out;
  ASSERT_FALSE(out.Open(dir / "run", "marker"));
  ASSERT_FALSE(out.Write("marker", "new"));
  EXPECT_EQ(ReadAll(dir / "run/marker"), "old");
  ASSERT_FALSE(out.Commit());
  EXPECT_EQ(ReadAll(dir / "run/marker"), "new");
  EXPECT_FALSE(std::filesystem::exists(dir / "run/leftover"));
}

TEST(OutputDirectory, RefusesWhatIsNoEarlierResult) {
  const TemporaryDirectory dir;
  dir.Write("run/letter", "dear");
  dir.Write("file", "text");
  std::filesystem::create_directory(dir / "empty");
  EXPECT_EQ(CheckReplaceable(dir / "run", "marker")->code, kExitCannotCreate);
  EXPECT_EQ(CheckReplaceable(dir / "file", "marker")->code, kExitCannotCreate);
  EXPECT_THAT(CheckReplaceable(dir / "no/run", "marker")->message, HasSubstr("no directory"));
  EXPECT_FALSE(CheckReplaceable(dir / "empty", "marker"));
  EXPECT_FALSE(CheckReplaceable(dir / "new", "marker"));
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
