#include "common/image/decode.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <new>
#include <vector>

#include "common/error.h"
#include "common/image/decoders.h"

namespace trilha {
namespace decoders {

void refuse(const std::string& label, const std::string& what) {
  throw InputError(label + " cannot be read: " + what);
}

void refuse_as_cut_short(const std::string& label) {
  refuse(label, "it ends before the image does; fetch or write it again");
}

// Radiance's format (Ward 1991), read here: stb_image 2.27 never comes back from a run of no bytes
// (CVE-2021-42715).
void hdr(const std::string& label, std::string_view bytes, ImageSink& sink) {
  std::size_t at = 0;
  const auto line = [&] {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string_view::npos) refuse_as_cut_short(label);
    const std::string_view text = bytes.substr(at, end - at);
    at = end + 1;
    return text;
  };
  for (std::string_view text = line(); !text.empty(); text = line())
    if (text.starts_with("FORMAT=") && text != "FORMAT=32-bit_rle_rgbe")
      refuse(label, "its FORMAT is not read; write FORMAT=32-bit_rle_rgbe");
  const std::string resolution(line());
  long long width = 0, height = 0;
  int used = 0;
  if (std::sscanf(resolution.c_str(), "-Y %9lld +X %9lld%n", &height, &width, &used) != 2 ||
      resolution.size() != static_cast<std::size_t>(used))
    refuse(label, "it has no line '-Y HEIGHT +X WIDTH' after its header; write rows from the top");
  sink.begin({width, height, ImageHeader::Depth::floats, Encoding::light, false, bytes.size()});

  const auto byte = [&] {
    if (at == bytes.size()) refuse_as_cut_short(label);
    return static_cast<unsigned char>(bytes[at++]);
  };
  const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height);
  const std::size_t least = std::min(4 * columns, 4 + 8 * ((columns + 126) / 127));  // bytes a row, all runs
  if (bytes.size() - at < rows * least) refuse_as_cut_short(label);
  std::vector<unsigned char> row(4 * columns);  // pixel by pixel where flat, else mantissa by mantissa
  std::vector<vec4> texels(columns);
  for (std::size_t y = 0; y < rows; ++y) {
    for (std::size_t k = 0; k < 4; ++k) row[k] = byte();
    const bool runs = columns >= 8 && row[0] == 2 && row[1] == 2 && row[2] < 128;
    if (runs) {
      if (static_cast<std::size_t>(row[2] << 8 | row[3]) != columns)
        refuse(label, "its row " + std::to_string(y) + " has another width than the image; write it again");
      for (std::size_t k = 0; k < row.size();) {
        const std::size_t rest = columns - k % columns;  // runs end with their row
        std::size_t count = byte();
        const bool same = count > 128;
        if (same) count -= 128;
        if (count == 0 || count > rest)
          refuse(label,
                 "its row " + std::to_string(y) + " has a run of bytes that does not fit; write it again");
        unsigned char value = same ? byte() : 0;
        for (; count > 0; --count) row[k++] = same ? value : byte();
      }
    } else {
      for (std::size_t k = 4; k < row.size(); ++k) row[k] = byte();
    }
    for (std::size_t x = 0; x < columns; ++x) {
      unsigned char rgbe[4];
      for (std::size_t k = 0; k < 4; ++k) rgbe[k] = row[runs ? k * columns + x : 4 * x + k];
      if (!runs && rgbe[0] == 1 && rgbe[1] == 1 && rgbe[2] == 1)
        refuse(label, "it has runs of the kind before 1991; write it with today's");
      texels[x] = vec4(0, 0, 0, 1);
      for (int c = 0; c < 3 && rgbe[3] > 0; ++c)
        texels[x][c] = std::ldexp(static_cast<float>(rgbe[c]), rgbe[3] - 136);
    }
    sink.row(texels.data());
  }
}

}  // namespace decoders

namespace {

using Decoder = void (*)(const std::string&, std::string_view, ImageSink&);

Decoder decoder_for(const std::string& label, std::string_view bytes) {
  if (bytes.empty()) decoders::refuse(label, "it is empty; name a .png, .jpg, .hdr or .exr file");
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return decoders::png;
  if (bytes.starts_with("\xff\xd8\xff")) return decoders::jpeg;
  if (bytes.starts_with("#?RADIANCE\n") || bytes.starts_with("#?RGBE\n")) return decoders::hdr;
  if (bytes.starts_with("\x76\x2f\x31\x01")) return decoders::exr;
  decoders::refuse(label,
                   "it is no image that is known here; name a PNG, JPEG, Radiance HDR or OpenEXR file");
}

}  // namespace

void decode(const std::string& label, std::string_view bytes, ImageSink& sink) try {
  decoder_for(label, bytes)(label, bytes, sink);
} catch (const std::bad_alloc&) {
  decoders::refuse(label, "it takes more memory than there is; write it again, or smaller");
}

std::string image_bytes(const std::string& path) {
  const std::string label = path + ":";
  constexpr std::size_t most_bytes = std::numeric_limits<int>::max();
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    decoders::refuse(label, "it is a directory; name an image in it");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file)
    decoders::refuse(label, std::strerror(errno) + std::string("; name a .png, .jpg, .hdr or .exr file"));
  std::string bytes;
  const auto read_up_to = [&](std::size_t size) {
    char block[1 << 16];
    while (bytes.size() < size) {
      const std::size_t n = std::fread(block, 1, std::min(sizeof block, size - bytes.size()), file.get());
      if (n == 0) break;
      bytes.append(block, n);
    }
    if (std::ferror(file.get())) decoders::refuse(label, std::strerror(errno));
  };
  read_up_to(16);  // what never ends, such as /dev/zero, is refused by its first bytes
  decoder_for(label, bytes);
  read_up_to(most_bytes + 1);
  if (bytes.size() > most_bytes) decoders::refuse(label, "it has more than 2 GiB; name a smaller file");
  return bytes;
}

}  // namespace trilha
