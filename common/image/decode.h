#pragma once
// Images as their files hold them, row by row: what read_image and the textures stand on.

#include <cstdint>
#include <string>
#include <string_view>

#include "common/image/image.h"

namespace trilha {

using u16vec4 = Vec4<std::uint16_t>;

/// What the header of an encoded image says, before anything is decoded.
struct ImageHeader {
  enum class Depth : std::uint8_t { bytes, shorts, floats };
  long long width = 0, height = 0;
  Depth depth = Depth::bytes;  ///< what the rows are made of
  Encoding encoding = Encoding::display;
  bool premultiplied = false;  ///< colours are multiplied with alpha
  std::size_t file_bytes = 0;
};

/// Who takes an image: first its header, then all rows from the top, each as red, green, blue, alpha. Grey
/// comes as three equal channels; what has no alpha is opaque (255, 65535, 1).
class ImageSink {
 public:
  virtual ~ImageSink() = default;
  /// Throws InputError where the image is not wanted. Nothing is decoded, or allocated for it, before.
  virtual void begin(const ImageHeader& header) = 0;
  virtual void row(const u8vec4* texels) = 0;
  virtual void row(const u16vec4* texels) = 0;
  virtual void row(const vec4* texels) = 0;
};

/// Decodes an image; what it is, its first bytes say. PNG (grey, palette, RGB, alpha, tRNS; up to 8 bits as
/// bytes, 16 as shorts; only the chunks that make the picture are read: no gamma, no profile) and JPEG
/// (baseline and progressive; grey, RGB, CMYK) are display values; Radiance HDR (RGBE, rows from the top; its
/// EXPOSURE is not applied) and OpenEXR (the data window of R, G, B or Y alone, and A; first part) are light
/// in floats.
///
/// Throws InputError, "LABEL cannot be read: what is wrong; what would be right", where it is none of these,
/// cut short, damaged, or asks for more than its bytes can hold: a PNG's rows take at most 1032 times its
/// bytes (deflate's best), a JPEG has at most 512 pixels a byte (a bit for each 8×8 block) and 100 scans, a
/// block of an EXR takes at most 2²⁶ bytes and 1024 times its file. An arithmetic-coded JPEG is refused. The
/// sink may have been given rows by then.
void decode(const std::string& label, std::string_view bytes, ImageSink& sink);

/// The bytes of the file at `path`. Throws InputError as decode does, where there is none, it is a folder, no
/// image that decode knows, or has more than 2 GiB.
std::string image_bytes(const std::string& path);

}  // namespace trilha
