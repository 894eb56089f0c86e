#include "common/image/files.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <stb_image_write.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <new>

#include "common/error.h"
#include "common/image/decode.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

std::string extension(const std::string& path) {
  std::string result = fs::path(path).extension().string();
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return result;
}

void append(void* context, void* data, int size) {
  auto& bytes = *static_cast<std::string*>(context);
  bytes.append(static_cast<const char*>(data), static_cast<std::size_t>(size));
}

/// The nearest colour that RGBE holds exactly: stb_image_write cuts mantissas off, which would darken every
/// image by a quarter of a per cent, and takes what is negative or not finite for something else.
vec3 rounded_to_rgbe(const vec3& light) {
  constexpr float brightest = 255 * 0x1p119f;
  vec3 result;
  for (int c = 0; c < 3; ++c) result[c] = light[c] > 0 ? std::min(light[c], brightest) : 0.0f;
  const float most = std::max({result.x, result.y, result.z});
  int exponent;
  std::frexp(most, &exponent);
  if (std::ldexp(most, 8 - exponent) >= 255.5f) ++exponent;  // rounds to the next power of two
  for (int c = 0; c < 3; ++c)
    result[c] = std::ldexp(std::nearbyint(std::ldexp(result[c], 8 - exponent)), exponent - 8);
  return result;
}

/// A file in memory, as OpenEXR writes it.
class ExrOutput : public Imf::OStream {
 public:
  explicit ExrOutput(std::string& bytes) : OStream("memory"), bytes_(bytes) {}
  void write(const char data[], int size) override {
    const std::size_t end = at_ + static_cast<std::size_t>(size);
    if (end > bytes_.size()) bytes_.resize(end);
    std::memcpy(&bytes_[at_], data, static_cast<std::size_t>(size));
    at_ = end;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t at) override { at_ = at; }

 private:
  std::string& bytes_;
  std::size_t at_ = 0;
};

std::string exr_bytes(const Image& light) {
  Imf::Header header(light.width, light.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  // written from, never to
  char* const pixels = reinterpret_cast<char*>(const_cast<vec3*>(light.pixels.data()));
  const std::size_t step = sizeof(vec3), row = step * static_cast<std::size_t>(light.width);
  for (const auto& [name, component] : {std::pair{"R", 0}, {"G", 1}, {"B", 2}}) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, pixels + component * sizeof(float), step, row));
  }
  std::string bytes;
  ExrOutput stream(bytes);
  {
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(light.height);
  }  // the destructor writes where the lines are
  return bytes;
}

/// What an image may be.
struct Limits {
  long long pixels;
  long long pixels_a_byte;  ///< of its file, beyond 2²⁰
  bool light;               ///< and nothing else
};

/// Takes the colours of an image, and none that is larger than the limits.
class Colours : public ImageSink {
 public:
  Colours(std::string path, const Limits& limits) : path_(std::move(path)), limits_(limits) {}

  void begin(const ImageHeader& header) override {
    const long long width = header.width, height = header.height;
    const auto refuse = [&](const std::string& what) {
      throw InputError(path_ + ": cannot be read: " + what);
    };
    if (limits_.light && header.encoding != Encoding::light)
      refuse("it holds colours for a screen; an environment is light: name a .hdr or .exr file");
    const std::string size =
        "an image of " + std::to_string(width) + "x" + std::to_string(height) + " pixels";
    if (width < 1 || height < 1 || width > most_side || height > most_side || width * height > limits_.pixels)
      refuse(size + " is refused; each side goes from 1 to " + std::to_string(most_side) +
             ", both together to " + std::to_string(limits_.pixels) + " pixels");
    const auto file_bytes = static_cast<long long>(header.file_bytes);
    const long long most = (1ll << 20) + limits_.pixels_a_byte * file_bytes;
    if (width * height > most)
      refuse(size + " from " + std::to_string(file_bytes) + " bytes is refused; " + std::to_string(most) +
             " pixels are the most that such a file may have");
    image = {static_cast<int>(width), static_cast<int>(height), header.encoding, {}};
  }
  void row(const u8vec4* texels) override { append(texels, 255.0f); }
  void row(const u16vec4* texels) override { append(texels, 65535.0f); }
  void row(const vec4* texels) override { append(texels, 1.0f); }

  Image image;

 private:
  template <class Texel>
  void append(const Texel* texels, float most) {
    if (image.pixels.empty())  // by now a row has been decoded
      image.pixels.reserve(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
    for (int x = 0; x < image.width; ++x)
      image.pixels.push_back(vec3(texels[x].x, texels[x].y, texels[x].z) / most);
  }

  std::string path_;
  Limits limits_;
};

Image read(const std::string& path, const Limits& limits) {
  Colours colours(path, limits);
  decode(path + ":", image_bytes(path), colours);
  return std::move(colours.image);
}

}  // namespace

void check_can_write(const std::string& path) {
  const std::string type = extension(path);
  std::error_code unknown;
  if (type != ".png" && type != ".hdr" && type != ".exr" && !fs::is_character_file(path, unknown))
    throw InputError(path + ": cannot be written: " +
                     (type.empty() ? "it has no extension that says what to write"
                                   : "'" + type + "' is no known image type") +
                     "; name a .png, .hdr or .exr file");
  check_can_write_file(path);
}

void write_image(const std::string& path, const Image& image) {
  const std::string type = extension(path);
  std::string bytes;
  int written = 1;
  if (type == ".exr") {
    bytes = exr_bytes(as_light(image));
  } else if (type == ".hdr") {
    Image light = as_light(image);
    for (vec3& pixel : light.pixels) pixel = rounded_to_rgbe(pixel);
    written = stbi_write_hdr_to_func(append, &bytes, image.width, image.height, 3, &light.pixels[0].x);
  } else {
    std::vector<unsigned char> encoded;
    encoded.reserve(3 * image.pixels.size());
    for (const vec3& pixel : image.pixels)
      for (int c = 0; c < 3; ++c)
        encoded.push_back(to_byte(image.encoding == Encoding::light ? srgb_encoded(pixel[c]) : pixel[c]));
    written =
        stbi_write_png_to_func(append, &bytes, image.width, image.height, 3, encoded.data(), 3 * image.width);
  }
  if (!written) throw std::bad_alloc();  // the only way in which the encoders fail
  write_whole_file(path, bytes);
}

Image read_image(const std::string& path) {
  return read(path, {.pixels = most_pixels, .pixels_a_byte = 1024, .light = false});
}

Image read_environment(const std::string& path) {
  return read(path, {.pixels = 1ll << 26, .pixels_a_byte = 256, .light = true});
}

}  // namespace trilha
