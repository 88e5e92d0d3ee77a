#include "plumb/base/json_depth.h"

#include <gtest/gtest.h>

#include <string>

namespace plumb {
namespace {

TEST(IsShallowJson, CountsWhatIsOpenAtATime) {
  EXPECT_TRUE(IsShallowJson(""));
  EXPECT_TRUE(IsShallowJson("[[], {}, [1]]", 2));
  EXPECT_FALSE(IsShallowJson("[{\"a\": [1]}]", 2));
  EXPECT_TRUE(IsShallowJson(std::string(kMaxJsonDepth, '[')));
  EXPECT_FALSE(IsShallowJson(std::string(kMaxJsonDepth + 1, '{')));
}

TEST(IsShallowJson, LeavesStringsOut) {
  EXPECT_TRUE(IsShallowJson(R"(["[[[[", "\"[[[", "\\"])", 1));
  EXPECT_FALSE(IsShallowJson(R"(["\\", [[1]]])", 2));
}

}  // namespace
}  // namespace plumb
