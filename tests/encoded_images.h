#pragma once
// Images as files, of kinds that write_image does not write.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <zlib.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>
// needs <cstdio>
#include <jpeglib.h>

#include "common/image/image.h"

namespace trilha::testing {

inline std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int k = 24; k >= 0; k -= 8) bytes += static_cast<char>(value >> k & 255);
  return bytes;
}

inline std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string both = type + data;
  const auto crc = crc32(0, reinterpret_cast<const Bytef*>(both.data()), static_cast<uInt>(both.size()));
  return big_endian(static_cast<std::uint32_t>(data.size())) + both +
         big_endian(static_cast<std::uint32_t>(crc));
}

inline std::string png_header(std::uint32_t width, std::uint32_t height, int depth, int colour_type,
                              int interlace = 0) {
  const char tail[] = {static_cast<char>(depth), static_cast<char>(colour_type), 0, 0,
                       static_cast<char>(interlace)};
  return "\x89PNG\r\n\x1a\n" +
         png_chunk("IHDR", big_endian(width) + big_endian(height) + std::string(tail, 5));
}

inline std::string deflated(const std::string& raw) {
  uLongf size = compressBound(raw.size());
  std::string result(size, '\0');
  compress2(reinterpret_cast<Bytef*>(result.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
            raw.size(), 9);
  result.resize(size);
  return result;
}

/// A PNG whose rows are the given bytes, without filters; `chunks` stand before its data. Interlaced: the
/// rows of all passes, one after the other.
inline std::string png(int width, int height, int depth, int colour_type,
                       const std::vector<std::string>& rows, const std::string& chunks = "",
                       int interlace = 0) {
  std::string raw;
  for (const std::string& row : rows) raw += '\0' + row;
  return png_header(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), depth, colour_type,
                    interlace) +
         chunks + png_chunk("IDAT", deflated(raw)) + png_chunk("IEND", "");
}

struct JpegKind {
  int quality = 90;
  int channels = 3;  ///< 1 grey (the red), 3 YCbCr, 4 CMYK as Adobe's programs store it
  bool progressive = false;
  bool arithmetic = false;
  int subsampling = 1;
};

inline std::string jpeg(const Image& image, const JpegKind& kind = {}) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &data, &size);
  jpeg.image_width = static_cast<JDIMENSION>(image.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.height);
  jpeg.input_components = kind.channels;
  jpeg.in_color_space = kind.channels == 1 ? JCS_GRAYSCALE : kind.channels == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, kind.quality, TRUE);
  jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = kind.subsampling;
  if (kind.channels == 4) jpeg.write_Adobe_marker = TRUE;
  if (kind.progressive) jpeg_simple_progression(&jpeg);
  jpeg.arith_code = kind.arithmetic;
  jpeg_start_compress(&jpeg, TRUE);
  for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y) {
    std::vector<unsigned char> row;
    for (std::size_t x = 0; x < static_cast<std::size_t>(image.width); ++x) {
      const vec3& pixel = image.pixels[y * static_cast<std::size_t>(image.width) + x];
      for (int c = 0; c < std::min(kind.channels, 3); ++c)
        row.push_back(static_cast<unsigned char>(pixel[c] * 255 + 0.5f));
      if (kind.channels == 4) row.push_back(255);  // no black ink; what the paper reflects
    }
    unsigned char* from = row.data();
    jpeg_write_scanlines(&jpeg, &from, 1);
  }
  jpeg_finish_compress(&jpeg);
  std::string bytes(reinterpret_cast<const char*>(data), size);
  std::free(data);
  jpeg_destroy_compress(&jpeg);
  return bytes;
}

/// Channels of floats in a data window that begins at (x, y); tiles of that side where it is not 0. The value
/// of channel c (from 0) in texel i is value(c, i), or i + 100·(c + 1).
inline void write_exr(const std::string& path, const std::vector<const char*>& channels, int x, int y,
                      int width, int height, Imf::Compression compression = Imf::ZIP_COMPRESSION,
                      unsigned tiles = 0, const std::function<float(std::size_t, std::size_t)>& value = {}) {
  const Imath::Box2i window({x, y}, {x + width - 1, y + height - 1});
  Imf::Header header(window, window);
  header.compression() = compression;
  Imf::FrameBuffer buffer;
  std::vector<std::vector<float>> values;
  for (const char* name : channels) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    values.emplace_back(static_cast<std::size_t>(width * height));
    for (std::size_t i = 0; i < values.back().size(); ++i)
      values.back()[i] = value ? value(values.size() - 1, i) : static_cast<float>(i + 100 * values.size());
    const std::ptrdiff_t first = x + static_cast<std::ptrdiff_t>(y) * width;
    const auto base = reinterpret_cast<std::uintptr_t>(values.back().data()) -
                      static_cast<std::uintptr_t>(first) * sizeof(float);
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(base), sizeof(float),
                                   sizeof(float) * static_cast<std::size_t>(width)));
  }
  if (tiles > 0) {
    header.setTileDescription({tiles, tiles, Imf::ONE_LEVEL});
    Imf::TiledOutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  } else {
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(height);
  }
}

}  // namespace trilha::testing
