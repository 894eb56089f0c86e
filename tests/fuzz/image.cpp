// Images of all formats, row by row and as read_image gives them.

#include "common/image/decode.h"
#include "common/image/files.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace trilha;

/// Counts rows, and wants no image of more than 2²⁰ pixels.
class Rows : public ImageSink {
 public:
  void begin(const ImageHeader& header) override {
    if (begun || header.width < 1 || header.height < 1 || header.width > 1 << 20 ||
        header.width * header.height > 1 << 20)
      throw InputError("label: cannot be read: too large");
    begun = true;
    this->header = header;
  }
  void row(const u8vec4* texels) override { count(texels, ImageHeader::Depth::bytes); }
  void row(const u16vec4* texels) override { count(texels, ImageHeader::Depth::shorts); }
  void row(const vec4* texels) override { count(texels, ImageHeader::Depth::floats); }

  ImageHeader header;
  bool begun = false;
  long long rows = 0;

 private:
  template <class Texel>
  void count(const Texel* texels, ImageHeader::Depth depth) {
    ++rows;
    volatile auto last = texels[header.width - 1].w;  // there to be read
    (void)last;
    if (!begun || depth != header.depth) std::abort();
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  Rows rows;
  bool is_read = false;
  fuzz::reads_or_refuses("label:", [&](const std::string& label) {
    decode(label, bytes, rows);
    is_read = true;
  });
  if (is_read && rows.rows != rows.header.height) std::abort();
  if (!is_read) return 0;
  return fuzz::reads_or_refuses(fuzz::file_of("image", data, size), [&](const std::string& path) {
    const Image image = read_image(path);
    if (image.width != rows.header.width || image.height != rows.header.height) std::abort();
    if (image.pixels.size() != static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
      std::abort();
  });
}
