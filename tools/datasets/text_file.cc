// Reading whole files, and the "one record a line" text files of data sets.
#include "tools/datasets/text_file.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

namespace plumb::tools {

Result<std::string> ReadFile(const std::string& path) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) {
    return Error{ErrorCode::kNotFound, path + ": no such file"};
  }
  if (std::filesystem::is_directory(path, code)) {
    return Error{ErrorCode::kNotFound, path + ": is a directory, a file is wanted"};
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  if (!file) return Error{ErrorCode::kNotFound, path + ": cannot be opened"};
  if (file.peek() != std::ifstream::traits_type::eof()) bytes << file.rdbuf();
  if (file.bad() || !bytes) return Error{ErrorCode::kNotFound, path + ": cannot be read"};
  return std::move(bytes).str();
}

std::vector<DataLine> DataLines(std::string_view text) {
  constexpr std::string_view kSeparators = " \t,\r";
  std::vector<DataLine> lines;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const size_t end = text.find('\n');
    std::string_view rest = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    DataLine line{number, {}};
    for (;;) {
      const size_t first = rest.find_first_not_of(kSeparators);
      if (first == std::string_view::npos) break;
      rest.remove_prefix(first);
      if (line.fields.empty() && rest.front() == '#') break;
      const size_t length = std::min(rest.find_first_of(kSeparators), rest.size());
      line.fields.push_back(rest.substr(0, length));
      rest.remove_prefix(length);
    }
    if (!line.fields.empty()) lines.push_back(std::move(line));
  }
  return lines;
}

Result<double> ParseNumber(std::string_view field) {
  double value = 0.0;
  const char* const end = field.data() + field.size();
  const auto [parsed, code] = std::from_chars(field.data(), end, value);
  if (code != std::errc() || parsed != end) {
    return Error{ErrorCode::kCorruptData, "\"" + Shortened(field) + "\" is not a number"};
  }
  if (!std::isfinite(value)) {
    return Error{ErrorCode::kCorruptData, "\"" + Shortened(field) + "\" is not finite"};
  }
  return value;
}

std::string Shortened(std::string_view value) {
  constexpr size_t kMaxBytes = 80;
  if (value.size() <= kMaxBytes) return std::string(value);
  size_t end = kMaxBytes;
  while (end > 0 && (value[end] & '\xC0') == '\x80') --end;  // no part of a UTF-8 character
  return std::string(value.substr(0, end)) + "...";
}

std::string Place(const std::string& path, const DataLine& line) {
  return path + ":" + std::to_string(line.number);
}

}  // namespace plumb::tools
