// The log sink: silent by default, filtered by level, replaceable from within itself.
#include "plumb/base/log.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Messages = std::vector<std::string>;

void Append(LogLevel, const char* message, void* user) {
  static_cast<Messages*>(user)->emplace_back(message);
}

class LogTest : public testing::Test {
 protected:
  void TearDown() override { SetLogSink(nullptr, nullptr, LogLevel::kWarning); }
  Messages messages_;
};

TEST_F(LogTest, WithoutASinkNothingIsPrinted) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  Log(LogLevel::kError, "nobody hears this");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

TEST_F(LogTest, SinkGetsItsLevelAndAbove) {
  SetLogSink(&Append, &messages_, LogLevel::kWarning);
  Log(LogLevel::kInfo, "info");
  Log(LogLevel::kWarning, "warning");
  Log(LogLevel::kError, "error");
  EXPECT_EQ(messages_, (Messages{"warning", "error"}));
}

TEST_F(LogTest, RemovedSinkIsNotCalled) {
  SetLogSink(&Append, &messages_, LogLevel::kDebug);
  SetLogSink(nullptr, nullptr, LogLevel::kDebug);
  Log(LogLevel::kError, "error");
  EXPECT_TRUE(messages_.empty());
}

TEST_F(LogTest, NoLockIsHeldWhileTheSinkRuns) {
  // Would deadlock otherwise.
  SetLogSink([](LogLevel, const char*, void* user) { SetLogSink(&Append, user, LogLevel::kDebug); },
             &messages_, LogLevel::kDebug);
  Log(LogLevel::kInfo, "first");
  Log(LogLevel::kInfo, "second");
  EXPECT_EQ(messages_, Messages{"second"});
}

}  // namespace
}  // namespace plumb
