// Reading whole files, and the "one record a line" text files of data sets.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "plumb/base/result.h"

namespace plumb::tools {

/// All bytes of a file or, unlike the library's ReadFile(), of a pipe.
/// @return kNotFound if `path` is missing, a directory or not readable.
Result<std::string> ReadFile(const std::string& path);

/// A line that carries data: not empty, not a comment (#).
struct DataLine {
  int number = 0;                        // from 1, as editors count
  std::vector<std::string_view> fields;  // split at blanks, tabs and commas; borrowed
};

/// The data lines of `text`, which must outlive the answer.
std::vector<DataLine> DataLines(std::string_view text);

/// A finite decimal number that fills the whole field.
/// @return kCorruptData naming the field.
Result<double> ParseNumber(std::string_view field);

/// `value` for a message: what is long ends in "..." after 80 bytes.
std::string Shortened(std::string_view value);

/// "FILE:LINE", the way errors name a place in a text file.
std::string Place(const std::string& path, const DataLine& line);

}  // namespace plumb::tools
