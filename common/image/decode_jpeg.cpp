// JPEG, by libjpeg-turbo.

#include <cstddef>
#include <cstdio>
// needs the two above
#include <jerror.h>
#include <jpeglib.h>

#include <memory>
#include <vector>

#include "common/image/decoders.h"

#ifndef JCS_ALPHA_EXTENSIONS
#error "libjpeg-turbo is wanted, which knows JCS_EXT_RGBA"
#endif

namespace trilha::decoders {
namespace {

constexpr int most_scans = 100;  // encoders write about ten; a scan of few bytes goes over the whole image

CLibrary& library_of(j_common_ptr jpeg) { return *static_cast<CLibrary*>(jpeg->client_data); }

void fail(j_common_ptr jpeg) {
  char text[JMSG_LENGTH_MAX];
  jpeg->err->format_message(jpeg, text);
  CLibrary& library = library_of(jpeg);
  std::snprintf(library.message.data(), library.message.size(), "%s", text);
  library.fail();
}

/// libjpeg warns, and makes up what is missing. What says nothing against the picture is let through.
void warn(j_common_ptr jpeg, int level) {
  if (level >= 0) return;  // a trace
  switch (jpeg->err->msg_code) {
    case JWRN_ADOBE_XFORM:
    case JWRN_EXTRANEOUS_DATA:
    case JWRN_JFIF_MAJOR:
      return;
    default:
      fail(jpeg);
  }
}

void watch(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number <= most_scans) return;
  CLibrary& library = library_of(jpeg);
  std::snprintf(library.message.data(), library.message.size(), "more than %d scans", most_scans);
  library.fail();
}

struct Reader {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  CLibrary library;
  Reader() {
    jpeg.err = jpeg_std_error(&errors);
    errors.error_exit = fail;
    errors.emit_message = warn;
    jpeg.client_data = &library;
    progress.progress_monitor = watch;
  }
  ~Reader() { jpeg_destroy_decompress(&jpeg); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
};

/// Adobe's programs store what the paper reflects, others the ink.
u8vec4 from_inks(const unsigned char* inks, bool reflected) {
  unsigned c[4];
  for (int k = 0; k < 4; ++k) c[k] = reflected ? inks[k] : 255u - inks[k];
  const auto under_black = [&](unsigned colour) {
    return static_cast<std::uint8_t>((colour * c[3] + 127) / 255);
  };
  return {under_black(c[0]), under_black(c[1]), under_black(c[2]), 255};
}

}  // namespace

void jpeg(const std::string& label, std::string_view bytes, ImageSink& sink) {
  Reader reader;
  jpeg_decompress_struct& jpeg = reader.jpeg;
  const auto call = [&](const auto& f) {
    if (reader.library.succeeds(f)) return;
    const int code = reader.errors.msg_code;
    if (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER || code == JERR_INPUT_EOF)
      refuse_as_cut_short(label);
    refuse(label, std::string("it is no JPEG that can be decoded (") + reader.library.message.data() +
                      "); fetch or write it again");
  };
  call([&] {
    jpeg_create_decompress(&jpeg);
    jpeg.progress = &reader.progress;
    jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    jpeg_read_header(&jpeg, TRUE);
  });
  ImageHeader header;
  header.width = jpeg.image_width;
  header.height = jpeg.image_height;
  header.file_bytes = bytes.size();
  sink.begin(header);
  const auto width = static_cast<std::size_t>(header.width), height = static_cast<std::size_t>(header.height);
  if (jpeg.arith_code)
    refuse(label, "it is arithmetic-coded, which hardly any program reads; write it Huffman-coded");
  if (bytes.size() < width * height / 512) refuse_as_cut_short(label);
  const J_COLOR_SPACE space = jpeg.jpeg_color_space;
  const bool inks = space == JCS_CMYK || space == JCS_YCCK;
  if (!inks && space != JCS_GRAYSCALE && space != JCS_RGB && space != JCS_YCbCr)
    refuse(label, "it is a JPEG of " + std::to_string(jpeg.num_components) +
                      " channels; write one of grey, RGB or CMYK");
  std::vector<u8vec4> texels(width);
  call([&] {
    jpeg.out_color_space = inks ? JCS_CMYK : JCS_EXT_RGBA;
    jpeg.dct_method = JDCT_ISLOW;
    jpeg.do_block_smoothing = FALSE;  // of images that lack their last scans, which are not shown
    jpeg_start_decompress(&jpeg);
  });
  for (std::size_t y = 0; y < height; ++y) {
    auto* to = reinterpret_cast<unsigned char*>(texels.data());
    call([&] { jpeg_read_scanlines(&jpeg, &to, 1); });
    if (inks)
      for (u8vec4& texel : texels)
        texel = from_inks(reinterpret_cast<const unsigned char*>(&texel), jpeg.saw_Adobe_marker != 0);
    sink.row(texels.data());
  }
  call([&] { jpeg_finish_decompress(&jpeg); });
}

}  // namespace trilha::decoders
