#pragma once
// Reading text files strictly: what the OBJ, MTL and BPT readers share.

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

namespace trilha {

/// Throws InputError with the one line that users see, "path:line: what"; line 0 means that none applies.
/// `what` says what is wrong and, after a semicolon, what would be right.
[[noreturn]] void refuse(const std::string& path, std::size_t line, const std::string& what);

/// "1 face", "3 faces".
std::string counted(std::uint64_t n, const std::string& what);

/// The text without what could break a line of output or steer a terminal: control characters, those of ISO
/// 8859 among them, become question marks.
std::string printable(std::string_view text);

/// The number with so many digits at most: 15 write 10000000, not 1e+07.
std::string shown(double number, int digits = 6);

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
/// number, has more than 100 characters, or is not finite as a float.
double parse_number(std::string_view word, const std::string& path, std::size_t line);

/// The same, as the float nearest to the decimal number: rounded once, however many digits it has.
float parse_float(std::string_view word, const std::string& path, std::size_t line);

/// A text file that is read in blocks, so that it need not fit into memory.
class TextFile {
 public:
  /// Throws InputError where read_text would, but for bytes that no text has.
  explicit TextFile(const std::string& path);

  const std::string& path() const { return path_; }
  std::size_t size() const { return size_; }  ///< bytes, when it was opened

  /// The next `room` bytes or, at the end of the file, fewer. Throws InputError where bytes are among them
  /// that no text has, or cannot be read.
  std::size_t read(char* to, std::size_t room);

 private:
  std::string path_;
  std::ifstream file_;
  std::size_t size_ = 0;
  std::size_t lines_ = 0;  // that ended in what was read
  char last_ = ' ';        // byte of it
};

/// Walks over the statements of a text: lines that are neither blank nor comments. A backslash before the end
/// of a line continues it; a byte order mark is skipped.
class Statements {
 public:
  /// Of a text in memory, of which blanks replace what joins lines.
  explicit Statements(std::string& text);

  /// Of a file, of which a block is in memory, or the longest statement. Throws InputError for what the file
  /// does, and for a statement of more than 2²⁴ bytes.
  explicit Statements(TextFile& file);

  Statements(const Statements&) = delete;
  Statements& operator=(const Statements&) = delete;

  /// Goes to the next statement; false at the end of the text. What the last one gave is gone.
  bool next();

  /// The line that the statement begins on, counted from 1.
  std::size_t line() const { return line_; }

  /// The next word of the statement; empty at its end.
  std::string_view word();

  /// What is left of the statement, without the spaces around it.
  std::string_view rest();

  /// Cuts off a comment at the end of the statement. To be called after its first word.
  void drop_comment();

 private:
  bool more();      // is there text at after_? Reads it where the block ends
  void end_line();  // moves after_ over the line break

  TextFile* file_ = nullptr;  // that more text comes from
  std::string block_;         // of the file
  char* cursor_ = nullptr;    // in the statement
  char* end_ = nullptr;       // of the statement
  char* after_ = nullptr;     // where the next one begins
  char* end_of_text_ = nullptr;
  std::size_t line_ = 0;
  std::size_t next_line_ = 1;
};

}  // namespace trilha
