// The log sink: silent by default, filtered by level, replaceable from within itself.
#include "plumb/base/log.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Messages = std::vector<std::string>;

class LogTest : public ::testing::Test {
 protected:
  void TearDown() override { SetLogSink({}, LogLevel::kWarning); }
  LogSink Append() {
    return [this](LogLevel, const char* message) { messages_.emplace_back(message); };
  }
  Messages messages_;
};

TEST_F(LogTest, WithoutASinkNothingIsPrinted) {
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  Log(LogLevel::kError, "nobody hears this");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
}

TEST_F(LogTest, SinkGetsItsLevelAndAbove) {
  SetLogSink(Append(), LogLevel::kWarning);
  Log(LogLevel::kInfo, "info");
  Log(LogLevel::kWarning, "warning");
  Log(LogLevel::kError, "error");
  EXPECT_EQ(messages_, (Messages{"warning", "error"}));
}

TEST_F(LogTest, RemovedSinkIsNotCalled) {
  SetLogSink(Append(), LogLevel::kDebug);
  SetLogSink({}, LogLevel::kDebug);
  Log(LogLevel::kError, "error");
  EXPECT_TRUE(messages_.empty());
}

TEST_F(LogTest, NoLockIsHeldWhileTheSinkRuns) {
  // Would deadlock otherwise.
  SetLogSink([this](LogLevel, const char*) { SetLogSink(Append(), LogLevel::kDebug); },
             LogLevel::kDebug);
  Log(LogLevel::kInfo, "first");
  Log(LogLevel::kInfo, "second");
  EXPECT_EQ(messages_, Messages{"second"});
}

}  // namespace
}  // namespace plumb
