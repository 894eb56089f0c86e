#include "common/scene/block_reader.h"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <new>
#include <type_traits>

#include "common/scene/text.h"

namespace trilha {

using namespace std::string_literals;

struct BlockReader::Unpacker {
  z_stream stream{};
  char input[64 * 1024];
  bool ended = false;

  Unpacker() {
    constexpr int gzip_alone = 15 + 16;  // the largest window, and no zlib header instead
    if (inflateInit2(&stream, gzip_alone) != Z_OK) throw std::bad_alloc();
  }
  ~Unpacker() { inflateEnd(&stream); }
  Unpacker(const Unpacker&) = delete;
  Unpacker& operator=(const Unpacker&) = delete;
};

BlockReader::BlockReader(const std::string& path) : path_(path), file_(open_file(path, size_)) {
  char first[6]{};
  file_.read(first, sizeof(first));
  const std::string_view start(first, static_cast<std::size_t>(file_.gcount()));
  file_.clear();
  file_.seekg(0);
  using namespace std::string_view_literals;
  for (const auto& [magic, packer] : {std::pair{"PK\3\4"sv, "zip"},
                                      {"\xfd"
                                       "7zXZ"sv,
                                       "xz"},
                                      {"BZh"sv, "bzip2"},
                                      {"\x28\xb5\x2f\xfd"sv, "Zstandard"}}) {
    if (start.starts_with(magic))
      refuse(path, 0, "is packed by "s + packer + "; unpack it first, only gzip is unpacked here");
  }
  if (start.starts_with("\x1f\x8b"sv)) unpacker_ = std::make_unique<Unpacker>();
  memory_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(block, most_left() + 1)));
  begin_ = end_ = memory_.data();
}

BlockReader::~BlockReader() = default;

std::size_t BlockReader::read_stored(char* to, std::size_t n) {
  file_.read(to, static_cast<std::streamsize>(std::min(n, size_ - stored_)));
  const auto got = static_cast<std::size_t>(file_.gcount());
  if (file_.bad() || (got < n && stored_ + got < size_))
    refuse(path_, 0, "cannot be read to its end; check the disk");
  stored_ += got;
  return got;
}

/// Is there another member? Zeros that fill up a tape's last block are none.
bool BlockReader::begin_member() {
  z_stream& stream = unpacker_->stream;
  for (;;) {
    while (stream.avail_in > 0 && *stream.next_in == 0) {
      ++stream.next_in;
      --stream.avail_in;
    }
    if (stream.avail_in > 0) break;
    stream.next_in = reinterpret_cast<Bytef*>(unpacker_->input);
    stream.avail_in = static_cast<uInt>(read_stored(unpacker_->input, sizeof(unpacker_->input)));
    if (stream.avail_in == 0) return false;
  }
  return inflateReset(&stream) == Z_OK;
}

std::size_t BlockReader::unpack(char* to, std::size_t n) {
  z_stream& stream = unpacker_->stream;
  stream.next_out = reinterpret_cast<Bytef*>(to);
  stream.avail_out = static_cast<uInt>(n);
  while (stream.avail_out > 0 && !unpacker_->ended) {
    if (stream.avail_in == 0) {
      stream.next_in = reinterpret_cast<Bytef*>(unpacker_->input);
      stream.avail_in = static_cast<uInt>(read_stored(unpacker_->input, sizeof(unpacker_->input)));
      if (stream.avail_in == 0)
        refuse(path_, 0, "ends amid what gzip packed; fetch it again, it was cut off");
    }
    const int result = inflate(&stream, Z_NO_FLUSH);
    if (result == Z_MEM_ERROR) throw std::bad_alloc();
    if (result == Z_STREAM_END) {
      unpacker_->ended = !begin_member();
    } else if (result != Z_OK) {
      refuse(path_, 0,
             "what gzip packed is damaged ("s + (stream.msg != nullptr ? stream.msg : "it makes no sense") +
                 "); fetch it again");
    }
  }
  const std::size_t got = n - stream.avail_out;
  if (got > most_unpacked(size_) - produced_)
    refuse(path_, 0, "unpacks to more than " + unpack_it_yourself());
  return got;
}

std::string BlockReader::unpack_it_yourself() const {
  return "the " + std::to_string(most_unpacked(size_)) + " bytes allowed for the " + std::to_string(size_) +
         " that gzip packed; if you trust it, unpack it yourself and name the result";
}

std::size_t BlockReader::read(char* to, std::size_t n) {
  const std::size_t got = unpacker_ ? unpack(to, n) : read_stored(to, n);
  produced_ += got;
  return got;
}

bool BlockReader::fill(std::size_t n) {
  const auto left = static_cast<std::size_t>(end_ - begin_);
  std::memmove(memory_.data(), begin_, left);
  begin_ = memory_.data();
  end_ = begin_ + left;
  end_ += read(memory_.data() + left, memory_.size() - left);
  return static_cast<std::size_t>(end_ - begin_) >= n;
}

bool BlockReader::skip(std::uint64_t n) {
  while (n > static_cast<std::size_t>(end_ - begin_)) {
    n -= static_cast<std::size_t>(end_ - begin_);
    begin_ = end_;
    if (!fill(1)) return false;
  }
  begin_ += n;
  return true;
}

namespace {

constexpr std::uint64_t most_for_a_byte = 1032;  // 258 bytes for a length and a distance of a bit each

}  // namespace

std::uint64_t BlockReader::most_left() const {
  const std::uint64_t most =
      unpacker_ ? std::min(most_for_a_byte * size_, most_unpacked(size_)) : std::uint64_t{size_};
  return most - std::min(most, produced_) + static_cast<std::size_t>(end_ - begin_);
}

std::string BlockReader::left_for_them(std::uint64_t left) const {
  if (unpacker_ && most_unpacked(size_) < most_for_a_byte * size_)
    return std::to_string(left) + " are left of " + unpack_it_yourself();
  return "the file has " + std::to_string(left) + " left for them";
}

void BlockReader::refuse_to_make(const std::string& what) const {
  refuse(path_, 0, "unpacks to " + what + " that take more than " + unpack_it_yourself());
}

namespace {

bool is_space(char c) { return c == ' ' || c == '\t'; }
bool is_line_break(char c) { return c == '\n' || c == '\r'; }

}  // namespace

void TextReader::refuse_here(const std::string& what) const { refuse(bytes_.path(), line_, what); }

void TextReader::skip_rest() {
  while (more()) {
    const char* const stop = std::find_if(bytes_.begin(), bytes_.end(), is_line_break);
    bytes_.move_to(stop);
    if (stop != bytes_.end()) return;
  }
}

void TextReader::end_line() {
  const bool carriage_return = *bytes_.begin() == '\r';
  bytes_.move_to(bytes_.begin() + 1);
  if (carriage_return && more() && *bytes_.begin() == '\n') bytes_.move_to(bytes_.begin() + 1);
  ++line_;
}

bool TextReader::line_ends() {
  while (more()) {
    const char* at = bytes_.begin();
    while (at != bytes_.end() && is_space(*at)) ++at;
    bytes_.move_to(at);
    if (at != bytes_.end()) return is_line_break(*at) || *at == comment_;
  }
  return true;
}

bool TextReader::next_line() {
  if (begun_) {
    skip_rest();
    if (more()) end_line();
  }
  begun_ = true;
  while (line_ends()) {
    skip_rest();
    if (!more()) return false;
    end_line();
  }
  return true;
}

std::string_view TextReader::word() {
  if (line_ends()) return {};
  constexpr std::size_t longest = 1000;
  bytes_.holds(longest + 1);
  const char* const begin = bytes_.begin();
  const char* const last =
      begin + std::min<std::size_t>(longest + 1, static_cast<std::size_t>(bytes_.end() - begin));
  const char* end = begin;
  while (end != last && !is_space(*end) && !is_line_break(*end) && *end != comment_) ++end;
  if (static_cast<std::size_t>(end - begin) > longest)
    refuse_here("a word of more than 1000 bytes, " + in_quotes({begin, longest}) + "; is this file damaged?");
  bytes_.move_to(end);
  return {begin, static_cast<std::size_t>(end - begin)};
}

bool TextReader::skip_word() {
  if (line_ends()) return false;
  while (more()) {
    const char* at = bytes_.begin();
    while (at != bytes_.end() && !is_space(*at) && !is_line_break(*at) && *at != comment_) ++at;
    bytes_.move_to(at);
    if (at != bytes_.end()) break;
  }
  return true;
}

namespace {

constexpr std::size_t longest_number = 100;  // as parse_number has it

}  // namespace

/// Brings a number's word into memory, whole.
void TextReader::begin_number(const char* what) {
  if (line_ends())
    refuse_here(std::string("the ") + (more() ? "line" : "file") + " ends where " + what +
                " should stand; all that belongs together stands on one line");
  bytes_.holds(longest_number + 1);
}

template <class Real>
Real TextReader::real(const char* what) {
  begin_number(what);
  const char* const word_begin = bytes_.begin();
  const bool plus = *word_begin == '+' && bytes_.end() - word_begin > 1 && word_begin[1] != '-';
  const char* const begin = word_begin + plus;
  Real value = 0;
  const auto [stop, error] = std::from_chars(begin, bytes_.end(), value);
  const bool ends = stop == bytes_.end() || is_space(*stop) || is_line_break(*stop) || *stop == comment_;
  if (error == std::errc() && ends && stop - begin <= static_cast<std::ptrdiff_t>(longest_number) &&
      std::isfinite(static_cast<float>(value))) {
    bytes_.move_to(stop);
    return value;
  }
  return static_cast<Real>(parse_number(word(), bytes_.path(), line_));  // too large or small, or no number
}
template float TextReader::real<float>(const char*);
template double TextReader::real<double>(const char*);

std::int64_t TextReader::whole(const char* what) {
  begin_number(what);
  const char* at = bytes_.begin();
  const char* const end = bytes_.end();
  const bool negative = *at == '-';
  if (*at == '-' || *at == '+') ++at;
  const char* const first = at;
  std::int64_t value = 0;
  for (; at != end && *at >= '0' && *at <= '9' && at - first < 18; ++at) value = 10 * value + (*at - '0');
  if (at == first || !(at == end || is_space(*at) || is_line_break(*at) || *at == comment_)) {
    refuse_here(in_quotes(word()) + " is not " + what + "; a whole number of at most 18 digits is wanted");
  }
  bytes_.move_to(at);
  return negative ? -value : value;
}

}  // namespace trilha
