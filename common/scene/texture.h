#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/math/vector.h"
#include "common/scene/load.h"

namespace trilha {

struct Scene;

/// What the numbers of a texture mean: colours, which files hold encoded as sRGB, or numbers that are used as
/// they are (normals, heights, roughness, alpha).
enum class TextureUse : std::uint8_t { colour, data };

/// What lies beyond the edge of a texture.
enum class Wrap : std::uint8_t { repeat, clamp, mirror };

/// width × height texels of red, green, blue, alpha, row by row from the top. One of the vectors is filled.
/// Colours are not multiplied with alpha.
struct TextureLevel {
  int width = 0, height = 0;
  std::vector<u8vec4> bytes;  ///< of what files hold in eight bits; colours encoded as sRGB
  std::vector<vec4> floats;   ///< of all else: linear, at most 1e30, alpha in [0, 1]
};

/// An image that a material names, with its mip chain. Texture coordinate (0, 0) is the lower left corner of
/// the image, (1, 1) the upper right one.
struct Texture {
  std::string name;  ///< its file, for people
  TextureUse use = TextureUse::colour;
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  bool has_alpha = false;      ///< a texel is not opaque
  bool missing = false;        ///< its file could not be found: magenta and black squares
  std::size_t file_bytes = 0;  ///< of the image that it was decoded from; 0: it was made
  std::size_t file_hash = 0;   ///< of those bytes: textures of the same image have the same
  /// Largest first; each half as wide and high as the one before, rounded down, at least 1; the last is 1×1.
  /// A texel is the mean of the area that it covers of the level before, texels that it covers in part
  /// counting by that part, so that the last is the mean of all; in linear light where the texture holds
  /// colours, whose alpha weighs them then: a colour that cannot be seen is in no mean. Bytes are rounded
  /// once, from means in floats, to the nearest in the encoding that they are stored in.
  std::vector<TextureLevel> levels;

  std::size_t bytes() const;
};

/// The texel in linear light, whatever it is stored as.
vec4 texel(const Texture& texture, int level, int x, int y);

/// The mean of the whole texture in linear light: its smallest level.
vec4 mean(const Texture& texture);

/// A texture with its whole mip chain from width × height texels in eight bits, row by row from the top.
Texture make_texture(std::string name, int width, int height, std::vector<u8vec4> texels, TextureUse use);

/// Gathers the textures of a scene while it is read: an image is decoded once for each use that is made of
/// it, however many materials name it, and not at all where LoadOptions::textures says no.
class TextureSet {
 public:
  TextureSet(Scene& scene, const LoadOptions& options) : scene_(scene), options_(options) {}

  struct How {
    TextureUse use = TextureUse::colour;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  };

  /// The number in Scene::textures of the image in that file, which line `line` of the file `path` names (0:
  /// no line applies); −1 where textures are not wanted (Scene::images_not_read counts them). A file that
  /// does not exist becomes the magenta texture, with a warning; eight are named, the last warning counts the
  /// others. Throws InputError, "FILE: cannot be read: …", where decode() does, where the file is a folder,
  /// no regular file or may not be read, or holds numbers that are not finite.
  ///
  /// Limits, asked of the header: sides of 16384, 2²⁶ texels; a file of n bytes has at most 2²⁰ + 1024·n
  /// texels of bytes (four bytes each), or a quarter as many of floats (16 bytes each): what deflate can make
  /// of n bytes, so that a PNG of one colour passes and a file of a kilobyte cannot ask for more than 8 MiB,
  /// 11 with its mip levels.
  ///
  /// The textures of a scene, with all levels and with the copies for other uses and wraps, take at most
  /// 2 GiB; those that come from files, of n bytes together, at most 320 MiB + 1024·n bytes, equal images
  /// counting once in n: a white PNG of 8192×8192 passes, and small files cannot add up to gigabytes. While
  /// an image becomes a texture it takes up to three times as much.
  std::int32_t add(const std::filesystem::path& file, const How& how, const std::string& path,
                   std::size_t line);

  /// The same for an image that lies inside the file `path` (glTF); `name` tells it from others there. What
  /// is refused is called "PATH:LINE: image 'NAME' cannot be read: …".
  std::int32_t add(const std::string& name, std::string_view encoded, const How& how, const std::string& path,
                   std::size_t line);

  /// Throws InputError, "PATH:LINE: …", where the textures of the scene, from wherever they came into it, are
  /// beyond the limits that it has for all of them.
  void check_bytes(const std::string& path, std::size_t line);

 private:
  std::int32_t number(const std::string& image, const std::string& label, const How& how,
                      const std::function<Texture()>& make);
  std::int32_t left_out(const std::string& image);
  void check_bytes(const std::string& what, std::uint64_t more, const Texture& of);
  void warn_of_missing(const std::string& image, const std::string& text);

  Scene& scene_;
  const LoadOptions& options_;
  std::map<std::string, std::int32_t> numbers_;  // by image, use and wraps
  std::set<std::string> left_out_;
  std::set<std::string> missing_;  // images that a warning was given for
  std::string many_missing_;       // the warning that counts those beyond the first
  std::size_t many_missing_at_ = 0;

  struct Bytes {
    std::uint64_t all = 0, from_files = 0, of_files = 0;
    std::set<std::pair<std::size_t, std::size_t>> files;  // by size and hash
  };
  Bytes bytes_;              // of the first textures of the scene,
  std::size_t counted_ = 0;  // so many
};

}  // namespace trilha
