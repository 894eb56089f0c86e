#pragma once
// Files that hold more bytes than the mesh that is made of them: read in blocks, never whole, and unpacked on
// the way.

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace trilha {

/// The bytes of a file from the first to the last, of which a block is in memory at a time. A file that gzip
/// packed (RFC 1952: its first two bytes say so, not its name) is unpacked, all its members, and its
/// checksums are verified. It may unpack to most_unpacked() bytes: gzip makes of real meshes an eighth or
/// more, of zeros a thousandth, which would fill any memory.
class BlockReader {
 public:
  /// That many bytes can be held at once.
  static constexpr std::size_t block = 256 * 1024;

  /// What that many bytes of a packed file may unpack to: 64 MB and 32 times as many.
  static constexpr std::uint64_t most_unpacked(std::uint64_t bytes) { return 64'000'000 + 32 * bytes; }

  /// Throws InputError where the file is missing, a folder, no regular file, not readable, or packed by a
  /// program whose files are not read: zip, xz, bzip2, Zstandard.
  explicit BlockReader(const std::string& path);
  ~BlockReader();
  BlockReader(const BlockReader&) = delete;
  BlockReader& operator=(const BlockReader&) = delete;

  const std::string& path() const { return path_; }

  /// The bytes in memory that were not yet skipped.
  const char* begin() const { return begin_; }
  const char* end() const { return end_; }

  /// Brings at least n ≤ block bytes into memory; false where the file has fewer left, which are in memory
  /// then. Moves what begin() points to. Throws InputError where the file cannot be read, or its packed data
  /// is damaged or unpacks to more than it may.
  bool holds(std::size_t n) { return static_cast<std::size_t>(end_ - begin_) >= n || fill(n); }

  /// Goes on to `to`, which lies between begin() and end().
  void move_to(const char* to) { begin_ = to; }

  /// Goes over that many bytes, in memory or not; false where the file has fewer.
  bool skip(std::uint64_t n);

  /// How many bytes can be left: exactly, or, for a packed file, as many as it may unpack to and as deflate
  /// (RFC 1951) can pack, which is 1032 for each.
  std::uint64_t most_left() const;

  /// "the file has 7 left for them", for a refusal of what needs more, where `left` of most_left() are left;
  /// says what to do where the file is packed and might hold more.
  std::string left_for_them(std::uint64_t left) const;

  /// How many vertices or triangles, of so many bytes each, may be made of the file: of a packed one what it
  /// may unpack to bounds them, too, for a byte of a strip becomes a triangle of twelve.
  std::uint64_t most_made(std::size_t bytes_each) const {
    return unpacker_ ? most_unpacked(size_) / bytes_each : UINT64_MAX;
  }
  [[noreturn]] void refuse_to_make(const std::string& what) const;

 private:
  struct Unpacker;

  bool fill(std::size_t n);
  std::size_t read(char* to, std::size_t n);
  std::size_t read_stored(char* to, std::size_t n);
  std::size_t unpack(char* to, std::size_t n);
  std::string unpack_it_yourself() const;
  bool begin_member();

  std::string path_;
  std::size_t size_ = 0;        // of the file on the disk
  std::size_t stored_ = 0;      // bytes read from there
  std::uint64_t produced_ = 0;  // bytes that reached the memory
  std::ifstream file_;
  std::vector<char> memory_;
  const char* begin_ = nullptr;
  const char* end_ = nullptr;
  std::unique_ptr<Unpacker> unpacker_;  // none where the file is plain
};

/// Walks over the words of a text, line by line: lines end in \n, \r\n or \r, words in spaces, tabs or a
/// line's end. `comment` begins a comment, wherever it stands, that its line ends.
class TextReader {
 public:
  explicit TextReader(BlockReader& bytes, char comment = '\n') : bytes_(bytes), comment_(comment) {}

  /// The line that is read, counted from 1.
  std::size_t line() const { return line_; }

  /// Goes to the next line that has a word; false at the end of the file.
  bool next_line();

  /// Has the line no more words?
  bool line_ends();

  /// The next word, until the reader moves on; empty at the end of the line. Throws InputError for one of
  /// more than 1000 bytes.
  std::string_view word();

  /// Goes over the next word; false at the end of the line.
  bool skip_word();

  /// The next word as a number, rounded once to that type (float or double), and finite as a float. `what`
  /// says what stands there. Throws InputError.
  template <class Real>
  Real real(const char* what);

  /// The next word as a whole number. Throws InputError.
  std::int64_t whole(const char* what);

  /// Throws InputError with the line.
  [[noreturn]] void refuse_here(const std::string& what) const;

 private:
  bool more() { return bytes_.begin() != bytes_.end() || bytes_.holds(1); }
  void begin_number(const char* what);
  void skip_rest();
  void end_line();

  BlockReader& bytes_;
  char comment_;
  bool begun_ = false;
  std::size_t line_ = 1;
};

}  // namespace trilha
