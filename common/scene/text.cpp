#include "common/scene/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>

#include "common/error.h"

namespace trilha {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t'; }
bool is_line_break(char c) { return c == '\n' || c == '\r'; }

// A control character that text files do not hold: neither tab, line break nor form feed.
bool is_binary(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return (byte < 9) | ((byte > 13) & (byte < 32));
}

}  // namespace

std::string printable(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : ' ');
    const bool eight_bits = byte == 0xc2 && next >= 0x80 && next < 0xa0;  // U+0080 to U+009F in UTF-8
    result += byte < 32 || byte == 127 || eight_bits ? '?' : text[i];
    i += eight_bits;
  }
  return result;
}

void refuse(const std::string& path, std::size_t line, const std::string& what) {
  throw InputError(printable(path) + (line == 0 ? "" : ":" + std::to_string(line)) + ": " + what);
}

std::string counted(std::uint64_t n, const std::string& what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

std::string shown(double number, int digits) {
  std::ostringstream text;
  text.precision(digits);
  text << number;
  return text.str();
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

namespace {

constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";

/// How many lines end in the text, which follows the byte `before`: in \n, \r\n or \r, as for Statements.
std::size_t line_ends(std::string_view text, char before) {
  auto ends = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  if (before == '\r' && text.starts_with('\n')) --ends;  // its line ended before
  for (std::size_t at = text.find('\r'); at != text.npos; at = text.find('\r', at + 1))
    ends += !text.substr(at + 1).starts_with('\n');
  return ends;
}

/// Refuses bytes that are in no text; so many lines came before, and that byte.
void check_text(const std::string& path, std::string_view text, std::size_t lines, char before) {
  unsigned any = 0;
  for (const char c : text) any |= unsigned{is_binary(c)};  // without a branch: many bytes at a time
  if (any == 0) return;
  const auto binary = std::find_if(text.begin(), text.end(), is_binary);
  lines += 1 + line_ends({text.begin(), binary}, before);
  refuse(path, lines,
         "byte " + std::to_string(static_cast<int>(*binary)) + " is in no text; a text file is wanted");
}

/// Is the number, which no floating-point number is near, too small rather than too large?
bool is_tiny(std::string_view digits) {
  const std::size_t exponent_at = std::min(digits.find_first_of("eE"), digits.size());
  std::string_view mantissa = digits.substr(0, exponent_at), exponent = digits.substr(exponent_at);
  const std::size_t point = std::min(mantissa.find('.'), mantissa.size());
  const auto first =
      static_cast<std::int64_t>(std::min(mantissa.find_first_of("123456789"), mantissa.size()));
  std::int64_t power =
      static_cast<std::int64_t>(point) - first;  // above 0: the digit stands before the point
  if (!exponent.empty()) {
    exponent.remove_prefix(exponent.starts_with("e+") || exponent.starts_with("E+") ? 2 : 1);
    std::int64_t value = 0;
    const auto result = std::from_chars(exponent.data(), exponent.data() + exponent.size(), value);
    if (result.ec == std::errc::result_out_of_range) return exponent[0] == '-';
    if (__builtin_add_overflow(power, value, &power)) return exponent[0] == '-';
  }
  return power <= 0;
}

template <class T>
T parsed(std::string_view word, const std::string& path, std::size_t line) {
  constexpr std::size_t longest = 100;
  if (word.size() > longest) {
    refuse(path, line, "a number of " + std::to_string(word.size()) + " characters; 9 digits fill a float");
  }
  std::string_view digits = word;
  const bool is_signed = !digits.empty() && (digits[0] == '+' || digits[0] == '-');
  if (is_signed) digits.remove_prefix(1);
  T value = 0;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, value);
  if (error == std::errc::invalid_argument || stop != end || digits[0] == '-') {
    refuse(path, line, in_quotes(word) + " is not a number; write it like -1.25 or 3e-4");
  }
  if (error == std::errc::result_out_of_range) {  // from_chars says the same of what is too small
    value = is_tiny(digits) ? T{0} : std::numeric_limits<T>::infinity();
  } else if (!std::isfinite(value)) {
    refuse(path, line, in_quotes(word) + " is not finite; only finite numbers are taken");
  }
  if (!std::isfinite(static_cast<float>(value))) {
    refuse(path, line, in_quotes(word) + " is beyond the largest float, 3.4e38; scale the model down");
  }
  return is_signed && word[0] == '-' ? -value : value;
}

}  // namespace

std::string read_text(const std::string& path) {
  std::string text = read_bytes(path);
  check_text(path, text, 0, ' ');
  return text;
}

double parse_number(std::string_view word, const std::string& path, std::size_t line) {
  return parsed<double>(word, path, line);
}

float parse_float(std::string_view word, const std::string& path, std::size_t line) {
  return parsed<float>(word, path, line);
}

TextFile::TextFile(const std::string& path) : path_(path) { file_ = open_file(path, size_); }

std::size_t TextFile::read(char* to, std::size_t room) {
  file_.read(to, static_cast<std::streamsize>(room));
  if (file_.bad()) refuse(path_, 0, "cannot be read to its end; check the disk");
  const auto size = static_cast<std::size_t>(file_.gcount());
  const std::string_view text(to, size);
  check_text(path_, text, lines_, last_);
  lines_ += line_ends(text, last_);
  if (size > 0) last_ = text.back();
  return size;
}

Statements::Statements(std::string& text) : cursor_(text.data()), end_(cursor_), after_(cursor_) {
  end_of_text_ = cursor_ + text.size();
  if (text.starts_with(byte_order_mark)) std::fill_n(text.data(), byte_order_mark.size(), ' ');
}

Statements::Statements(TextFile& file) : file_(&file) {
  cursor_ = end_ = after_ = end_of_text_ = block_.data();
  if (more() && std::string_view(after_, end_of_text_).starts_with(byte_order_mark))
    after_ += byte_order_mark.size();
}

bool Statements::more() {
  if (after_ != end_of_text_) return true;
  if (file_ == nullptr) return false;
  // The statement so far goes to the front of the block, which grows where it takes half of it.
  constexpr std::size_t usual = std::size_t{1} << 18, most = std::size_t{1} << 24;
  const std::size_t least = std::min(usual, file_->size() + 1);
  const auto kept = static_cast<std::size_t>(end_of_text_ - cursor_);
  const auto end = static_cast<std::size_t>(end_ - cursor_);
  if (kept == most)
    refuse(file_->path(), line_, "a statement of more than " + std::to_string(most) + " bytes; split it");
  std::copy(cursor_, end_of_text_, block_.data());
  if (2 * kept >= block_.size()) block_.resize(std::clamp(2 * block_.size(), least, most));
  cursor_ = block_.data();
  end_ = cursor_ + end;
  after_ = cursor_ + kept;
  end_of_text_ = after_ + file_->read(after_, block_.size() - kept);
  if (after_ == end_of_text_) file_ = nullptr;
  return after_ != end_of_text_;
}

void Statements::end_line() {
  if (!more()) return;
  const bool carriage_return = *after_++ == '\r';
  if (carriage_return && more() && *after_ == '\n') ++after_;
  ++next_line_;
}

bool Statements::next() {
  for (;;) {
    cursor_ = end_ = after_;
    if (!more()) return false;
    line_ = next_line_;
    while (more() && is_space(*after_)) cursor_ = end_ = ++after_;
    const bool is_comment = more() && *after_ == '#';
    for (;;) {
      do {
        while (after_ != end_of_text_ && !is_line_break(*after_)) ++after_;
        end_ = after_;
        if (is_comment) cursor_ = end_;  // which may be longer than memory
      } while (after_ == end_of_text_ && more());
      end_line();
      // A comment may end in a backslash, as paths do, without taking the next line with it.
      if (is_comment || end_ == cursor_ || end_[-1] != '\\') break;
      std::fill(end_ - 1, after_, ' ');
    }
    if (!is_comment && !rest().empty()) return true;
  }
}

std::string_view Statements::word() {
  while (cursor_ != end_ && is_space(*cursor_)) ++cursor_;
  const char* const word = cursor_;
  while (cursor_ != end_ && !is_space(*cursor_)) ++cursor_;
  return {word, static_cast<std::size_t>(cursor_ - word)};
}

std::string_view Statements::rest() {
  while (cursor_ != end_ && is_space(*cursor_)) ++cursor_;
  const char* last = end_;
  while (last != cursor_ && is_space(last[-1])) --last;
  return {cursor_, static_cast<std::size_t>(last - cursor_)};
}

void Statements::drop_comment() {
  char* comment = cursor_;
  while ((comment = std::find(comment, end_, '#')) != end_) {
    if (is_space(comment[-1])) {  // not in "1.#INF"
      end_ = comment;
      return;
    }
    ++comment;
  }
}

}  // namespace trilha
