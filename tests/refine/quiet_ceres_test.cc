// Who decides what glog prints.
#include "plumb/refine/quiet_ceres.h"

#include <string>

#include <glog/logging.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

// Both in one process: glog can be initialised once, and the library decides once.
TEST(QuietCeres, SilencesAnUninitialisedGlogAndLeavesTheHostsAlone) {
  QuietCeres();
  ::testing::internal::CaptureStderr();
  LOG(WARNING) << "from a solver";
  LOG(ERROR) << "from a solver";
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");

  // The host takes over and wants to see everything: it stays that way.
  FLAGS_minloglevel = google::GLOG_INFO;
  FLAGS_logtostderr = true;
  google::InitGoogleLogging("host");
  QuietCeres();
  EXPECT_EQ(FLAGS_minloglevel, google::GLOG_INFO);
  ::testing::internal::CaptureStderr();
  LOG(WARNING) << "from the host";
  EXPECT_NE(::testing::internal::GetCapturedStderr().find("from the host"), std::string::npos);
  google::ShutdownGoogleLogging();
}

}  // namespace
}  // namespace plumb
