#include "common/image/image.h"

#include <stb_image_write.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "common/error.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw InputError(path + ": cannot be written: " + what +
                   "; name a .png or .hdr file in a folder with room for it");
}

std::string extension(const std::string& path) {
  std::string result = fs::path(path).extension().string();
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return result;
}

/// A file that takes its name only when it is complete. A path that is no plain file, such as /dev/stdout, is
/// written to directly.
class WholeFile {
 public:
  explicit WholeFile(std::string path) : path_(std::move(path)), temporary_(path_) {
    std::error_code ignored;
    if (fs::is_directory(path_, ignored)) refuse(path_, "it is a directory");
    if (!fs::exists(path_, ignored) || fs::is_regular_file(path_, ignored))
      temporary_ = path_ + ".part" + std::to_string(getpid());
    file_ = std::fopen(temporary_.c_str(), "wb");
    if (!file_) refuse(path_, std::strerror(errno));
  }
  ~WholeFile() { discard(); }

  void write(const void* data, std::size_t bytes) {
    if (std::fwrite(data, 1, bytes, file_) != bytes) fail();
  }

  void commit() {
    if (std::fflush(file_) != 0 || (temporary_ != path_ && fsync(fileno(file_)) != 0)) fail();
    if (std::fclose(std::exchange(file_, nullptr)) != 0) fail();
    if (temporary_ != path_ && std::rename(temporary_.c_str(), path_.c_str()) != 0) fail();
    temporary_ = path_;
  }

 private:
  void discard() {
    if (file_) std::fclose(std::exchange(file_, nullptr));
    if (temporary_ != path_) std::remove(temporary_.c_str());
  }
  [[noreturn]] void fail() {
    const std::string reason = std::strerror(errno);
    discard();
    refuse(path_, reason);
  }

  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
};

void append(void* context, void* data, int size) {
  auto& bytes = *static_cast<std::string*>(context);
  bytes.append(static_cast<const char*>(data), static_cast<std::size_t>(size));
}

unsigned char to_byte(float value) {  // NaN and what lies below 0 become 0
  return static_cast<unsigned char>(value > 0 ? std::min(value, 1.0f) * 255.0f + 0.5f : 0.0f);
}

}  // namespace

float srgb_encoded(float light) {
  const float x = light > 0 ? std::min(light, 1.0f) : 0.0f;
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}

float srgb_decoded(float display) {
  const float x = display > 0 ? std::min(display, 1.0f) : 0.0f;
  return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}

void check_can_write(const std::string& path) {
  const std::string type = extension(path);
  std::error_code unknown;
  if (type != ".png" && type != ".hdr" && !fs::is_character_file(path, unknown))
    refuse(path, type.empty() ? "it has no extension that says what to write"
                              : "'" + type + "' is no known image type");
  WholeFile attempt(path);
}

void write_image(const std::string& path, const Image& image) {
  const auto count = static_cast<std::size_t>(image.width) * image.height;
  std::string bytes;
  int written = 0;
  if (extension(path) == ".hdr") {
    std::vector<vec3> light = image.pixels;
    if (image.encoding == Encoding::display)
      for (vec3& pixel : light)
        for (int c = 0; c < 3; ++c) pixel[c] = srgb_decoded(pixel[c]);
    written = stbi_write_hdr_to_func(append, &bytes, image.width, image.height, 3, &light[0].x);
  } else {
    std::vector<unsigned char> encoded(3 * count);
    for (std::size_t i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) {
        const float value = image.pixels[i][c];
        encoded[3 * i + c] = to_byte(image.encoding == Encoding::light ? srgb_encoded(value) : value);
      }
    written =
        stbi_write_png_to_func(append, &bytes, image.width, image.height, 3, encoded.data(), 3 * image.width);
  }
  if (!written) refuse(path, "the encoder failed, out of memory");
  WholeFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace trilha
