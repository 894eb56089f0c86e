#include "common/image/files.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <stb_image.h>
#include <stb_image_write.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <new>
#include <string_view>

#include "common/error.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_to_read(const std::string& path, const std::string& what) {
  throw InputError(path + ": cannot be read: " + what);
}

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

unsigned char to_byte(float value) {  // NaN and what lies below 0 become 0
  return static_cast<unsigned char>(value > 0 ? std::min(value, 1.0f) * 255.0f + 0.5f : 0.0f);
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

/// A file in memory, as OpenEXR writes and reads it.
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

class ExrInput : public Imf::IStream {
 public:
  explicit ExrInput(const std::string& bytes) : IStream("memory"), bytes_(bytes) {}
  bool read(char data[], int size) override {
    if (size < 0 || at_ > bytes_.size() || bytes_.size() - at_ < static_cast<std::size_t>(size))
      throw std::runtime_error("it ends before the image does");
    std::memcpy(data, bytes_.data() + at_, static_cast<std::size_t>(size));
    at_ += static_cast<std::size_t>(size);
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t at) override { at_ = at; }

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

/// The channels of these names as the first components of `pixels`, of which the first is the pixel (x, y).
Imf::FrameBuffer frame_buffer(vec3* pixels, int x, int y, int width, const std::vector<const char*>& names) {
  Imf::FrameBuffer result;
  const std::size_t step = sizeof(vec3), row = step * static_cast<std::size_t>(width);
  // OpenEXR adds x·step + y·row to the address it is given; in integers that may pass through anything
  const auto origin = reinterpret_cast<std::uintptr_t>(pixels) - static_cast<std::uintptr_t>(x) * step -
                      static_cast<std::uintptr_t>(y) * row;
  for (std::size_t c = 0; c < names.size(); ++c)
    result.insert(names[c],
                  Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(origin + c * sizeof(float)), step, row));
  return result;
}

std::string exr_bytes(const Image& light) {
  const std::vector<const char*> names = {"R", "G", "B"};
  Imf::Header header(light.width, light.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const char* name : names) header.channels().insert(name, Imf::Channel(Imf::FLOAT));
  std::string bytes;
  ExrOutput stream(bytes);
  {
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(frame_buffer(const_cast<vec3*>(light.pixels.data()), 0, 0, light.width, names));
    file.writePixels(light.height);
  }  // the destructor writes where the lines are
  return bytes;
}

/// An image of this size, or a refusal.
Image sized(const std::string& path, long long width, long long height, Encoding encoding) {
  if (width < 1 || height < 1 || width > most_side || height > most_side || width * height > most_pixels)
    refuse_to_read(path, "an image of " + std::to_string(width) + "x" + std::to_string(height) +
                             " pixels is refused; each side goes from 1 to " + std::to_string(most_side) +
                             ", both together to " + std::to_string(most_pixels) + " pixels");
  return {static_cast<int>(width), static_cast<int>(height), encoding, {}};
}

[[noreturn]] void refuse_as_cut_short(const std::string& path) {
  refuse_to_read(path, "it ends before the image does; fetch or write it again");
}

/// The bytes as stb_image asks for them, with a note of whether it asked for more than there were: it fills
/// up with zeros what is cut short, and says nothing.
struct StbSource {
  const std::string& bytes;
  std::size_t at = 0;
  bool overrun = false;

  static int read(void* user, char* data, int size) {
    auto& self = *static_cast<StbSource*>(user);
    const std::size_t n = std::min(static_cast<std::size_t>(size), self.bytes.size() - self.at);
    std::memcpy(data, self.bytes.data() + self.at, n);
    self.at += n;
    self.overrun = self.overrun || (n == 0 && size > 0);
    return static_cast<int>(n);
  }
  static void skip(void* user, int size) {
    auto& self = *static_cast<StbSource*>(user);
    const long long to = static_cast<long long>(self.at) + size;
    const auto end = static_cast<long long>(self.bytes.size());
    self.overrun = self.overrun || to > end;
    self.at = static_cast<std::size_t>(std::clamp(to, 0ll, end));
  }
  static int eof(void* user) {
    const auto& self = *static_cast<StbSource*>(user);
    return self.at == self.bytes.size();
  }
};

/// What the header of a PNG or JPEG says its size is. stb_image would say of a PNG that is too large for it
/// that it is no image.
Image png_or_jpeg_size(const std::string& path, const std::string& bytes, bool png) {
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  int width = 0, height = 0, channels = 0;
  if (!png) {
    if (!stbi_info_from_memory(data, static_cast<int>(bytes.size()), &width, &height, &channels))
      refuse_to_read(path, "it is no JPEG with a header that can be read; fetch or write it again");
    return sized(path, width, height, Encoding::display);
  }
  if (bytes.size() < 24) refuse_as_cut_short(path);
  if (bytes.compare(12, 4, "IHDR") != 0)
    refuse_to_read(path, "it is a PNG whose first chunk is not IHDR; write it again");
  const auto integer = [&](std::size_t at) {
    return static_cast<long long>(data[at]) << 24 | data[at + 1] << 16 | data[at + 2] << 8 | data[at + 3];
  };
  return sized(path, integer(16), integer(20), Encoding::display);
}

/// Refuses Huffman tables that stb_image 2.27 trusts: of more than 256 codes, which overrun its arrays, of
/// 256 codes in nine bits or fewer, and those that a scan uses and nothing defines, which fail an assertion
/// and with it the program.
void check_huffman_tables(const std::string& path, const std::string& bytes) {
  const auto byte = [&](std::size_t at) -> unsigned {
    return at < bytes.size() ? static_cast<unsigned char>(bytes[at]) : 0;
  };
  const auto refuse_table = [&] {
    refuse_to_read(path, "it is no JPEG that can be decoded (bad Huffman table); fetch or write it again");
  };
  bool defined[2][4] = {}, progressive = false;  // by kind, DC or AC, and by slot
  for (std::size_t at = 2; at < bytes.size();) {
    if (byte(at++) != 0xff) continue;
    const unsigned marker = byte(at);
    if (marker == 0xff) continue;
    const std::size_t begin = at + 3, end = at + 1 + (byte(at + 1) << 8 | byte(at + 2));
    ++at;
    if (marker == 0 || (marker >= 0xd0 && marker <= 0xd7)) continue;  // inside a scan
    if (marker == 0xd9) return;
    progressive = progressive || marker == 0xc2;
    if (marker == 0xc4)
      for (std::size_t table = begin; table < end;) {
        const unsigned kind = byte(table) >> 4, slot = byte(table) & 15;
        std::size_t codes = 0, short_codes = 0;
        for (std::size_t bits = 1; bits <= 16; ++bits) {
          codes += byte(table + bits);
          if (bits <= 9) short_codes = codes;
        }
        if (kind > 1 || slot > 3 || codes > 256 || short_codes > 255) refuse_table();
        defined[kind][slot] = true;
        table += 17 + codes;
      }
    if (marker == 0xda) {
      const std::size_t channels = byte(begin);
      const unsigned first = byte(begin + 1 + 2 * channels), refines = byte(begin + 3 + 2 * channels) >> 4;
      for (std::size_t k = 0; k < channels; ++k) {
        const unsigned slots[2] = {byte(begin + 2 + 2 * k) >> 4, byte(begin + 2 + 2 * k) & 15};
        const bool used[2] = {!progressive || (first == 0 && refines == 0), !progressive || first > 0};
        for (int kind = 0; kind < 2; ++kind)
          if (used[kind] && (slots[kind] > 3 || !defined[kind][slots[kind]])) refuse_table();
      }
    }
    at = end;
  }
}

Image read_png_or_jpeg(const std::string& path, const std::string& bytes, bool png) {
  if (!png) check_huffman_tables(path, bytes);
  Image image = png_or_jpeg_size(path, bytes, png);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  // each block of 8×8 pixels takes a bit of a JPEG; stb_image would make up what is missing
  if (!png && bytes.size() < pixels / 512) refuse_as_cut_short(path);
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  int width = 0, height = 0, channels = 0;
  const bool deep = stbi_is_16_bit_from_memory(data, static_cast<int>(bytes.size()));
  StbSource source{bytes};
  const stbi_io_callbacks calls{StbSource::read, StbSource::skip, StbSource::eof};
  const std::unique_ptr<void, void (*)(void*)> decoded(
      deep ? static_cast<void*>(stbi_load_16_from_callbacks(&calls, &source, &width, &height, &channels, 3))
           : stbi_load_from_callbacks(&calls, &source, &width, &height, &channels, 3),
      stbi_image_free);
  if (source.overrun) refuse_as_cut_short(path);
  if (!decoded || width != image.width || height != image.height) {
    const char* reason = stbi_failure_reason();
    refuse_to_read(path, std::string("it is no ") + (png ? "PNG" : "JPEG") + " that can be decoded (" +
                             (reason ? reason : "unknown") + "); fetch or write it again");
  }
  const auto convert = [&](const auto* values, float most) {
    image.pixels.resize(pixels);
    for (vec3& pixel : image.pixels)
      for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(*values++) / most;
  };
  if (deep)
    convert(static_cast<const stbi_us*>(decoded.get()), 65535.0f);
  else
    convert(static_cast<const stbi_uc*>(decoded.get()), 255.0f);
  return image;
}

/// Radiance's format (Ward 1991), read here: stb_image 2.27 never comes back from a run of no bytes
/// (CVE-2021-42715).
Image read_hdr(const std::string& path, const std::string& bytes) {
  std::size_t at = 0;
  const auto line = [&] {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string::npos) refuse_as_cut_short(path);
    const std::string text = bytes.substr(at, end - at);
    at = end + 1;
    return text;
  };
  for (std::string text = line(); !text.empty(); text = line())
    if (text.rfind("FORMAT=", 0) == 0 && text != "FORMAT=32-bit_rle_rgbe")
      refuse_to_read(path, "its '" + text + "' is not read; write FORMAT=32-bit_rle_rgbe");
  const std::string resolution = line();
  long long width = 0, height = 0;
  int used = 0;
  if (std::sscanf(resolution.c_str(), "-Y %9lld +X %9lld%n", &height, &width, &used) != 2 ||
      resolution.size() != static_cast<std::size_t>(used))
    refuse_to_read(path, "it has no line '-Y HEIGHT +X WIDTH' after its header; write rows from the top");
  Image image = sized(path, width, height, Encoding::light);

  const auto byte = [&] {
    if (at == bytes.size()) refuse_as_cut_short(path);
    return static_cast<unsigned char>(bytes[at++]);
  };
  const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height);
  const std::size_t least = std::min(4 * columns, 4 + 8 * ((columns + 126) / 127));  // bytes a row, all runs
  if (bytes.size() - at < rows * least) refuse_as_cut_short(path);
  std::vector<unsigned char> row(4 * columns);  // pixel by pixel where flat, else mantissa by mantissa
  for (long long y = 0; y < height; ++y) {
    for (std::size_t k = 0; k < 4; ++k) row[k] = byte();
    const bool runs = width >= 8 && row[0] == 2 && row[1] == 2 && row[2] < 128;
    if (runs) {
      if ((row[2] << 8 | row[3]) != width)
        refuse_to_read(path, "its row " + std::to_string(y) + " has another width than the image");
      for (std::size_t k = 0; k < row.size();) {
        const std::size_t rest = columns - k % columns;  // runs end with their row
        std::size_t count = byte();
        const bool same = count > 128;
        if (same) count -= 128;
        if (count == 0 || count > rest)
          refuse_to_read(path, "its row " + std::to_string(y) + " has a run of bytes that does not fit");
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
        refuse_to_read(path, "it has runs of the kind before 1991; write it with today's");
      vec3 light(0);
      for (int c = 0; c < 3 && rgbe[3] > 0; ++c)
        light[c] = std::ldexp(static_cast<float>(rgbe[c]), rgbe[3] - 136);
      image.pixels.push_back(light);
    }
  }
  return image;
}

/// Walks through the header of an OpenEXR file before the library does, which allocates what an attribute or
/// the data window claims: returns the size of each part's data window, or refuses.
Image exr_size(const std::string& path, const std::string& bytes) {
  std::size_t at = 4;
  const auto integer = [&] {
    if (bytes.size() - at < 4) refuse_as_cut_short(path);
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k)
      value |= std::uint32_t{static_cast<unsigned char>(bytes[at++])} << 8 * k;
    return static_cast<std::int32_t>(value);
  };
  const auto text = [&] {
    const std::size_t end = bytes.find('\0', at);
    if (end == std::string::npos) refuse_as_cut_short(path);
    const std::string result = bytes.substr(at, end - at);
    at = end + 1;
    return result;
  };
  const bool several_parts = integer() & 0x1000;
  Image size;
  do {
    for (std::string name = text(); !name.empty(); name = text()) {
      const std::string type = text();
      const std::int32_t length = integer();
      if (length < 0 || static_cast<std::size_t>(length) > bytes.size() - at) refuse_as_cut_short(path);
      const std::size_t end = at + static_cast<std::size_t>(length);
      if (name == "dataWindow" && length == 16) {
        const long long x0 = integer(), y0 = integer(), x1 = integer(), y1 = integer();
        const Image part = sized(path, x1 - x0 + 1, y1 - y0 + 1, Encoding::light);
        if (size.width == 0) size = part;
      }
      at = end;
    }
    if (several_parts && at == bytes.size()) refuse_as_cut_short(path);
  } while (several_parts && bytes[at] != '\0');
  return size;
}

Image read_exr(const std::string& path, const std::string& bytes) {
  Image image = exr_size(path, bytes);
  try {
    ExrInput stream(bytes);
    Imf::InputFile file(stream, 0);
    const Imath::Box2i window = file.header().dataWindow();
    if (window.max.x - window.min.x + 1 != image.width || window.max.y - window.min.y + 1 != image.height)
      throw std::runtime_error("its data window is not in its first header");
    if (!file.isComplete()) throw std::runtime_error("it ends before the image does");
    const Imf::ChannelList& channels = file.header().channels();
    const bool coloured = channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
    if (!coloured && (!channels.findChannel("Y") || channels.findChannel("RY") || channels.findChannel("BY")))
      throw std::runtime_error("it has neither the channels R, G, B nor Y alone");
    const std::vector<const char*> names =
        coloured ? std::vector<const char*>{"R", "G", "B"} : std::vector<const char*>{"Y"};
    for (const char* name : names)
      if (channels[name].xSampling != 1 || channels[name].ySampling != 1)
        throw std::runtime_error(std::string("its channel ") + name + " does not have every pixel");
    const auto width = static_cast<std::size_t>(image.width);
    for (int y = 0; y < image.height; y += 256) {  // grows with what was decoded, not with what is claimed
      const int rows = std::min(256, image.height - y);
      image.pixels.resize(image.pixels.size() + width * static_cast<std::size_t>(rows));
      file.setFrameBuffer(frame_buffer(image.pixels.data(), window.min.x, window.min.y, image.width, names));
      file.readPixels(window.min.y + y, window.min.y + y + rows - 1);
    }
    if (!coloured)
      for (vec3& pixel : image.pixels) pixel = vec3(pixel.x);
  } catch (const std::bad_alloc&) {
    refuse_to_read(path, "it takes more memory than there is; write it again, or smaller");
  } catch (const std::exception& error) {
    std::string reason = error.what();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    refuse_to_read(path, reason + "; write an OpenEXR file of R, G and B");
  }
  return image;
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
  constexpr std::size_t most_bytes = std::numeric_limits<int>::max();
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) refuse_to_read(path, "it is a directory; name an image in it");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file)
    refuse_to_read(path, std::strerror(errno) + std::string("; name a .png, .jpg, .hdr or .exr file"));
  std::string bytes;
  const auto read_up_to = [&](std::size_t size) {
    char block[1 << 16];
    while (bytes.size() < size) {
      const std::size_t n = std::fread(block, 1, std::min(sizeof block, size - bytes.size()), file.get());
      if (n == 0) break;
      bytes.append(block, n);
    }
    if (std::ferror(file.get())) refuse_to_read(path, std::strerror(errno));
  };
  const auto starts = [&](std::string_view magic) { return bytes.compare(0, magic.size(), magic) == 0; };
  read_up_to(16);  // what never ends, such as /dev/zero, is refused by its first bytes
  const bool png = starts("\x89PNG\r\n\x1a\n"), jpeg = starts("\xff\xd8\xff");
  const bool hdr = starts("#?RADIANCE\n") || starts("#?RGBE\n"), exr = starts("\x76\x2f\x31\x01");
  if (bytes.empty()) refuse_to_read(path, "it is empty; name a .png, .jpg, .hdr or .exr file");
  if (!png && !jpeg && !hdr && !exr)
    refuse_to_read(path, "it is no image that is known here; name a PNG, JPEG, Radiance HDR or OpenEXR file");
  read_up_to(most_bytes + 1);
  if (bytes.size() > most_bytes) refuse_to_read(path, "it has more than 2 GiB; name a smaller file");
  if (hdr) return read_hdr(path, bytes);
  if (exr) return read_exr(path, bytes);
  return read_png_or_jpeg(path, bytes, png);
}

}  // namespace trilha
