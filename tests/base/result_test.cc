#include "plumb/base/result.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <type_traits>

namespace plumb {
namespace {

Result<int> Half(int value) {
  if (value % 2 != 0) return Error{ErrorCode::kInvalidArgument, std::to_string(value) + " is odd"};
  return value / 2;
}

TEST(Result, HoldsAValue) {
  const Result<int> result = Half(8);
  ASSERT_TRUE(result);
  EXPECT_TRUE(result.has_value());
  EXPECT_EQ(*result, 4);
}

TEST(Result, HoldsAnError) {
  const Result<int> result = Half(7);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(result.error().message, "7 is odd");
}

TEST(Result, MovesItsValueOut) {
  Result<std::unique_ptr<int>> result = std::make_unique<int>(5);
  const std::unique_ptr<int> value = *std::move(result);
  EXPECT_EQ(*value, 5);
}

TEST(Result, GivesAccessToMembers) {
  Result<std::string> result = std::string("line");
  result->push_back('s');
  const Result<std::string>& constant = result;
  EXPECT_EQ(constant->size(), 5u);
}

TEST(Status, IsOkWithoutValue) {
  EXPECT_TRUE(Ok());
  const Status status = Error{ErrorCode::kIoError, "disk full"};
  EXPECT_FALSE(status);
}

TEST(Status, IsNotCopiedFromABoolean) {
  static_assert(!std::is_convertible_v<bool, Status>);
  static_assert(!std::is_convertible_v<Status, bool>, "only explicitly, as a condition");
}

}  // namespace
}  // namespace plumb
