// Timestamps as data sets write them: decimal seconds, exact to the nanosecond.
#include "tools/datasets/timestamp.h"

#include <algorithm>
#include <cstdio>

#include "tools/datasets/text_file.h"

namespace plumb::tools {
namespace {

constexpr uint64_t kNsPerSecond = 1'000'000'000;
constexpr uint64_t kMaxSeconds = 9'000'000'000;
constexpr size_t kDecimals = 9;

bool AllDigits(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

Error Refused(std::string_view text, const char* reason) {
  return Error{ErrorCode::kCorruptData, "\"" + Shortened(text) + "\" " + reason};
}

}  // namespace

Result<int64_t> ParseTimestamp(std::string_view seconds) {
  std::string_view digits = seconds;
  const bool negative = !digits.empty() && digits.front() == '-';
  if (negative) digits.remove_prefix(1);
  const size_t point = std::min(digits.find('.'), digits.size());
  const std::string_view whole = digits.substr(0, point);
  std::string_view fraction = point < digits.size() ? digits.substr(point + 1) : "";
  if (whole.empty() || !AllDigits(whole) || !AllDigits(fraction)) {
    return Refused(seconds, "is not a timestamp in decimal seconds");
  }
  while (fraction.size() > kDecimals && fraction.back() == '0') fraction.remove_suffix(1);
  if (fraction.size() > kDecimals) return Refused(seconds, "is finer than nanoseconds");

  uint64_t value = 0;
  for (const char c : whole) {
    value = 10 * value + static_cast<uint64_t>(c - '0');
    if (value > kMaxSeconds) return Refused(seconds, "is beyond 9e9 s");
  }
  uint64_t nanoseconds = 0;
  for (size_t i = 0; i < kDecimals; ++i) {
    nanoseconds =
        10 * nanoseconds + (i < fraction.size() ? static_cast<uint64_t>(fraction[i] - '0') : 0);
  }
  value = value * kNsPerSecond + nanoseconds;
  if (value > kMaxSeconds * kNsPerSecond) return Refused(seconds, "is beyond 9e9 s");
  return negative ? -static_cast<int64_t>(value) : static_cast<int64_t>(value);
}

std::string FormatTimestamp(int64_t timestamp_ns) {
  const uint64_t magnitude = timestamp_ns < 0 ? 0 - static_cast<uint64_t>(timestamp_ns)
                                              : static_cast<uint64_t>(timestamp_ns);
  const auto whole = static_cast<unsigned long long>(magnitude / kNsPerSecond);
  const auto nanoseconds = static_cast<unsigned long long>(magnitude % kNsPerSecond);
  char text[40];
  if (nanoseconds % 1000 == 0) {
    std::snprintf(text, sizeof(text), "%s%llu.%06llu", timestamp_ns < 0 ? "-" : "", whole,
                  nanoseconds / 1000);
  } else {
    std::snprintf(text, sizeof(text), "%s%llu.%09llu", timestamp_ns < 0 ? "-" : "", whole,
                  nanoseconds);
  }
  return text;
}

}  // namespace plumb::tools
