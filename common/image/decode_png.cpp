// PNG, by libpng.

#include <png.h>

#include <bit>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "common/image/decoders.h"

namespace trilha::decoders {
namespace {

struct Source {
  std::string_view bytes;
  std::size_t at = 0;
  bool overrun = false;
};

void read(png_structp png, png_bytep data, std::size_t size) {
  auto& source = *static_cast<Source*>(png_get_io_ptr(png));
  if (source.bytes.size() - source.at < size) {
    source.overrun = true;
    png_error(png, "it ends before the image does");
  }
  std::memcpy(data, source.bytes.data() + source.at, size);
  source.at += size;
}

void fail(png_structp png, png_const_charp message) {
  auto& library = *static_cast<CLibrary*>(png_get_error_ptr(png));
  std::snprintf(library.message.data(), library.message.size(), "%s", message);
  library.fail();
}

/// A bad chunk that the picture does not need is left out; damage to the picture's own data is an error
/// whatever libpng thinks of it.
void warn(png_structp png, png_const_charp message) {
  if (std::strncmp(message, "IDAT", 4) == 0) fail(png, message);
}

struct Reader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  CLibrary library;
  Reader() {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &library, fail, warn);
    if (png != nullptr) info = png_create_info_struct(png);
    if (info == nullptr) {
      png_destroy_read_struct(&png, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
};

}  // namespace

void png(const std::string& label, std::string_view bytes, ImageSink& sink) {
  // the header's fixed place, read here: libpng reads on to the picture's data before it tells
  if (bytes.size() < 33) refuse_as_cut_short(label);
  if (bytes.substr(12, 4) != "IHDR")
    refuse(label, "it is a PNG whose first chunk is not IHDR; write it again");
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(bytes[at]); };
  const auto integer = [&](std::size_t at) {
    return static_cast<long long>(byte(at)) << 24 | byte(at + 1) << 16 | byte(at + 2) << 8 | byte(at + 3);
  };
  const bool deep = byte(24) == 16;
  ImageHeader header;
  header.width = integer(16);
  header.height = integer(20);
  header.depth = deep ? ImageHeader::Depth::shorts : ImageHeader::Depth::bytes;
  header.file_bytes = bytes.size();
  sink.begin(header);
  const auto width = static_cast<std::size_t>(header.width), height = static_cast<std::size_t>(header.height);

  Source source{bytes};
  Reader reader;
  const auto call = [&](const auto& f) {
    if (reader.library.succeeds(f)) return;
    if (source.overrun) refuse_as_cut_short(label);
    refuse(label, std::string("it is no PNG that can be decoded (") + reader.library.message.data() +
                      "); fetch or write it again");
  };
  std::size_t packed_row = 0;
  int passes = 0;
  call([&] {
    png_structp png = reader.png;
    png_set_read_fn(png, &source, read);
    png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);  // all but the picture's own
    png_read_info(png, reader.info);
    packed_row = png_get_rowbytes(png, reader.info);
    const bool alpha = (png_get_color_type(png, reader.info) & PNG_COLOR_MASK_ALPHA) != 0 ||
                       png_get_valid(png, reader.info, PNG_INFO_tRNS) != 0;
    png_set_expand(png);
    png_set_gray_to_rgb(png);
    if (!alpha) png_set_add_alpha(png, 0xffff, PNG_FILLER_AFTER);
    if (deep && std::endian::native == std::endian::little) png_set_swap(png);
    passes = png_set_interlace_handling(png);
    png_read_update_info(png, reader.info);
  });
  const std::size_t row = width * (deep ? sizeof(u16vec4) : sizeof(u8vec4));
  if (png_get_rowbytes(reader.png, reader.info) != row ||
      png_get_image_width(reader.png, reader.info) != width ||
      png_get_image_height(reader.png, reader.info) != height)
    refuse(label, "it is no PNG that can be decoded (its headers differ); fetch or write it again");
  if (height * (packed_row + 1) / 1032 > bytes.size()) refuse_as_cut_short(label);  // deflate's best

  const auto give = [&](const unsigned char* data) {
    deep ? sink.row(reinterpret_cast<const u16vec4*>(data)) : sink.row(reinterpret_cast<const u8vec4*>(data));
  };
  const std::size_t rows_kept = passes > 1 ? height : 1;
  // from calloc: pages of an interlaced image are there once something is decoded into them
  const std::unique_ptr<unsigned char, void (*)(void*)> texels(
      static_cast<unsigned char*>(std::calloc(rows_kept, row)), std::free);
  if (!texels) throw std::bad_alloc();
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t y = 0; y < height; ++y) {
      unsigned char* const to = texels.get() + (passes > 1 ? y * row : 0);
      call([&] { png_read_row(reader.png, to, nullptr); });
      if (pass == passes - 1) give(to);
    }
  call([&] { png_read_end(reader.png, nullptr); });
}

}  // namespace trilha::decoders
