#include "common/scene/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "common/error.h"

namespace trilha {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t'; }
bool is_line_break(char c) { return c == '\n' || c == '\r'; }

// A control character that text files do not hold: neither tab, line break nor form feed.
bool is_binary(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte < 9 || (byte > 13 && byte < 32);
}

std::string printable(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
  }
  return result;
}

}  // namespace

void refuse(const std::string& path, std::size_t line, const std::string& what) {
  throw InputError(printable(path) + (line == 0 ? "" : ":" + std::to_string(line)) + ": " + what);
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::size_t length = std::min(text.size(), longest);
  if (length < text.size()) {  // not amid a letter
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xc0) == 0x80) --length;
  }
  std::string result = "'";
  result += printable(text.substr(0, length));
  result += length < text.size() ? "…'" : "'";
  return result;
}

std::ifstream open_file(const std::string& path, std::size_t& size) {
  if (path.empty()) throw InputError("no file was named; name one");
  if (path.find('\0') != std::string::npos)
    refuse(path, 0, "a name with a NUL byte; no file can be called that");
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::is_directory(status)) refuse(path, 0, "is a folder; name a file in it");
  if (!std::filesystem::exists(status)) refuse(path, 0, "no such file; check the name");
  if (!std::filesystem::is_regular_file(status))
    refuse(path, 0, "is not a regular file; save it to one first");
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff end = file ? static_cast<std::streamoff>(file.tellg()) : -1;
  if (end < 0) refuse(path, 0, "cannot be read; check its permissions");
  size = static_cast<std::size_t>(end);
  file.seekg(0);
  return file;
}

std::string read_bytes(const std::string& path, std::size_t most) {
  std::size_t size = 0;
  std::ifstream file = open_file(path, size);
  if (size > most)
    refuse(path, 0, "has " + std::to_string(size) + " bytes; " + std::to_string(most) + " are the most");
  std::string bytes(size, '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(size)))
    refuse(path, 0, "cannot be read to its end; check the disk");
  return bytes;
}

std::string read_text(const std::string& path) {
  std::string text = read_bytes(path);
  const auto binary = std::find_if(text.begin(), text.end(), is_binary);
  if (binary != text.end()) {
    const auto line = 1 + std::count(text.begin(), binary, '\n');
    refuse(path, static_cast<std::size_t>(line),
           "byte " + std::to_string(static_cast<int>(*binary)) + " is in no text; a text file is wanted");
  }
  return text;
}

double parse_number(std::string_view word, const std::string& path, std::size_t line) {
  constexpr std::size_t longest = 100;
  if (word.size() > longest) {
    refuse(path, line, "a number of " + std::to_string(word.size()) + " characters; 9 digits fill a float");
  }
  std::string_view digits = word;
  const bool is_signed = !digits.empty() && (digits[0] == '+' || digits[0] == '-');
  if (is_signed) digits.remove_prefix(1);
  double value = 0;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, value);
  if (error == std::errc::invalid_argument || stop != end || digits[0] == '-') {
    refuse(path, line, in_quotes(word) + " is not a number; write it like -1.25 or 3e-4");
  }
  if (error == std::errc::result_out_of_range) {  // from_chars says the same of what is too small
    value = digits.find("e-") != digits.npos || digits.find("E-") != digits.npos ? 0 : HUGE_VAL;
  } else if (!std::isfinite(value)) {
    refuse(path, line, in_quotes(word) + " is not finite; only finite numbers are taken");
  }
  if (!std::isfinite(static_cast<float>(value))) {
    refuse(path, line, in_quotes(word) + " is beyond the largest float, 3.4e38; scale the model down");
  }
  return is_signed && word[0] == '-' ? -value : value;
}

Statements::Statements(std::string& text)
    : cursor_(text.data()),
      word_(cursor_),
      end_(cursor_),
      after_(cursor_),
      end_of_text_(cursor_ + text.size()) {
  if (text.starts_with("\xef\xbb\xbf")) std::fill_n(text.data(), 3, ' ');
}

void Statements::end_line() {
  if (after_ == end_of_text_) return;
  const bool carriage_return = *after_++ == '\r';
  if (carriage_return && after_ != end_of_text_ && *after_ == '\n') ++after_;
  ++next_line_;
}

bool Statements::next() {
  while (after_ != end_of_text_) {
    line_ = next_line_;
    cursor_ = after_;
    while (cursor_ != end_of_text_ && is_space(*cursor_)) ++cursor_;
    const bool is_comment = cursor_ != end_of_text_ && *cursor_ == '#';
    after_ = cursor_;
    for (;;) {
      while (after_ != end_of_text_ && !is_line_break(*after_)) ++after_;
      end_ = after_;
      end_line();
      // A comment may end in a backslash, as paths do, without taking the next line with it.
      if (is_comment || end_ == cursor_ || end_[-1] != '\\') break;
      std::fill(end_ - 1, after_, ' ');
    }
    if (!is_comment && !rest().empty()) return true;
  }
  return false;
}

std::string_view Statements::word() {
  while (cursor_ != end_ && is_space(*cursor_)) ++cursor_;
  word_ = cursor_;
  while (cursor_ != end_ && !is_space(*cursor_)) ++cursor_;
  return {word_, static_cast<std::size_t>(cursor_ - word_)};
}

void Statements::replace_word(std::string_view shorter) {
  std::fill(std::copy(shorter.begin(), shorter.end(), word_), cursor_, ' ');
}

std::string_view Statements::rest() {
  while (cursor_ != end_ && is_space(*cursor_)) ++cursor_;
  const char* last = end_;
  while (last != cursor_ && is_space(last[-1])) --last;
  return {cursor_, static_cast<std::size_t>(last - cursor_)};
}

void Statements::drop_comment() {
  char* comment = cursor_;
  while (comment != end_ && !(*comment == '#' && is_space(comment[-1]))) ++comment;  // not in "1.#INF"
  std::fill(comment, end_, ' ');
  end_ = comment;
}

}  // namespace trilha
