#pragma once
// Packed input may be a thousand times as long as it looks.

#include <zlib.h>

#include <cstddef>
#include <cstdint>

namespace trilha::fuzz {

/// Does what gzip packed there unpack to more than a megabyte? Reading it would take the time of a thousand
/// inputs. Counts all members, up to where one is damaged; false for bytes that gzip did not pack.
inline bool unpacks_to_much(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t most = 1'000'000;
  static Bytef nowhere[64 * 1024];
  if (size < 2 || data[0] != 0x1f || data[1] != 0x8b) return false;
  z_stream stream{};
  if (inflateInit2(&stream, 15 + 16) != Z_OK) return false;
  stream.next_in = const_cast<Bytef*>(data);
  stream.avail_in = static_cast<uInt>(size);
  std::size_t unpacked = 0;
  for (int result = Z_OK; result == Z_OK && unpacked <= most;) {
    stream.next_out = nowhere;
    stream.avail_out = sizeof nowhere;
    result = inflate(&stream, Z_NO_FLUSH);
    unpacked += sizeof nowhere - stream.avail_out;
    while (result == Z_STREAM_END && stream.avail_in > 0 && *stream.next_in == 0) {
      ++stream.next_in;
      --stream.avail_in;
    }
    if (result == Z_STREAM_END && stream.avail_in > 0) result = inflateReset(&stream);
  }
  inflateEnd(&stream);
  return unpacked > most;
}

}  // namespace trilha::fuzz
