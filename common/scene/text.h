#pragma once
// Reading text files strictly: what the OBJ, MTL and BPT readers share.

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <string_view>

namespace trilha {

/// Throws InputError with the one line that users see, "path:line: what"; line 0 means that none applies.
/// `what` says what is wrong and, after a semicolon, what would be right.
[[noreturn]] void refuse(const std::string& path, std::size_t line, const std::string& what);

/// The text in quotes, cut to 40 bytes, without what could break a line of output.
std::string in_quotes(std::string_view text);

/// Opens the file and says how many bytes it has. Throws InputError where it is missing, a folder, no regular
/// file, or not readable.
std::ifstream open_file(const std::string& path, std::size_t& size);

/// The bytes of the file. Throws InputError where that is missing, a folder, not readable, or has more than
/// `most` bytes.
std::string read_bytes(const std::string& path, std::size_t most = SIZE_MAX);

/// The text of the file. Throws InputError where that is missing, a folder, not readable, or holds bytes that
/// no text has.
std::string read_text(const std::string& path);

/// The decimal number that is the whole word, whatever the locale. Throws InputError where the word is no
/// number, or one that is not finite as a float.
double parse_number(std::string_view word, const std::string& path, std::size_t line);

/// Walks over the statements of a text: lines that are neither blank nor comments. A backslash before the end
/// of a line continues it. The text is normalised on the way, without moving a byte: a byte order mark and
/// continuations become spaces, so that a simpler parser can read it afterwards.
class Statements {
 public:
  explicit Statements(std::string& text);

  /// Goes to the next statement; false at the end of the text.
  bool next();

  /// The line that the statement begins on, counted from 1.
  std::size_t line() const { return line_; }

  /// The next word of the statement; empty at its end.
  std::string_view word();

  /// Overwrites the word that word() gave last with one that is no longer, and spaces.
  void replace_word(std::string_view shorter);

  /// What is left of the statement, without the spaces around it.
  std::string_view rest();

  /// Blanks a comment at the end of the statement. To be called after its first word.
  void drop_comment();

 private:
  void end_line();  // moves after_ over the line break

  char* cursor_;  // in the statement
  char* word_;    // the last that was given
  char* end_;     // of the statement
  char* after_;   // where the next one begins
  char* end_of_text_;
  std::size_t line_ = 0;
  std::size_t next_line_ = 1;
};

}  // namespace trilha
