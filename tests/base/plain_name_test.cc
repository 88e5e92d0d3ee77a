#include "plumb/base/plain_name.h"

#include <string>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(PlainName, HoldsLettersDigitsAndTwoMarks) {
  for (const char* name : {"", "lsd", "nano", "My_Net-2", "0"}) EXPECT_TRUE(IsPlainName(name));
  for (const char* name : {"a/b", "a.safetensors", "a b", "a\n", "\x1b[2J", "n\xc3\xa4no"}) {
    EXPECT_FALSE(IsPlainName(name)) << name;
  }
  EXPECT_FALSE(IsPlainName(std::string_view("a\0b", 3)));
  EXPECT_TRUE(IsPlainName(std::string(63, 'x')));
  EXPECT_FALSE(IsPlainName(std::string(64, 'x')));
}

}  // namespace
}  // namespace plumb
