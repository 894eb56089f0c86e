#include "common/scene/texture.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "common/error.h"
#include "common/image/decode.h"
#include "common/scene/scene.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

constexpr long long most_side = 16384, most_texels = 1ll << 26;
constexpr std::uint64_t most_bytes = 2ull << 30, most_bytes_of_nothing = 320ull << 20, most_ratio = 1024;
constexpr std::size_t most_named = 8;  // images that are missing
constexpr float most_light = 1e30f;    // where sums and quotients are still far from infinity

// ---- bytes and numbers ----

/// What a byte of a colour means.
const std::array<float, 256>& light_of_byte() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> result;
    for (std::size_t i = 0; i < 256; ++i) result[i] = srgb_decoded(static_cast<float>(i) / 255.0f);
    return result;
  }();
  return table;
}

/// Light → the byte whose colour is nearest as it is encoded: how many of the 255 borders between bytes lie
/// at or below it. Near black 1/8192 of light holds less than half a border's distance, so that the search
/// that starts at the borders below its cell is over after a step.
class NearestByte {
 public:
  NearestByte() {
    for (std::size_t i = 0; i < 255; ++i) {
      const double light = srgb_decoded_double((static_cast<double>(i) + 0.5) / 255);
      borders_[i] = static_cast<float>(light);
      if (borders_[i] < light) borders_[i] = std::nextafter(borders_[i], 1.0f);  // the same floats lie below
    }
    borders_[255] = std::numeric_limits<float>::infinity();
    for (std::size_t cell = 0, byte = 0; cell <= cells; ++cell) {
      while (borders_[byte] <= static_cast<float>(cell) / cells) ++byte;
      first_[cell] = static_cast<std::uint8_t>(byte);
    }
  }
  std::uint8_t operator()(float light) const {
    const float x = light > 0 ? std::min(light, 1.0f) : 0.0f;
    std::uint8_t byte = first_[static_cast<std::size_t>(x * cells)];
    while (borders_[byte] <= x) ++byte;
    return byte;
  }

 private:
  static constexpr std::size_t cells = 8192;  // a power of two: scaling by it rounds nothing
  std::array<float, 256> borders_;
  std::array<std::uint8_t, cells + 1> first_;
};

/// How texels of eight bits are read and written while means are taken: colours as light, data and alpha in
/// units of a byte, where sums of bytes are exact.
struct Bytes {
  const std::array<float, 256>& light = light_of_byte();
  bool colour;
  vec4 read(const u8vec4& t) const {
    return colour ? vec4(light[t.x], light[t.y], light[t.z], static_cast<float>(t.w)) : vec4(t);
  }
  u8vec4 written(const vec4& t) const {
    static const NearestByte nearest;
    const auto whole = [](float x) { return static_cast<std::uint8_t>(x + 0.5f); };
    return colour ? u8vec4(nearest(t.x), nearest(t.y), nearest(t.z), whole(t.w))
                  : u8vec4(whole(t.x), whole(t.y), whole(t.z), whole(t.w));
  }
};

// ---- means ----

/// The texels of an axis that texel i of the next level covers: up to three, with the part that each has of
/// it. Of 2m + 1 texels, each of the m below covers 2 + 1/m.
struct Footprint {
  int first = 0, count = 1;
  float parts[3] = {1, 0, 0};

  Footprint(int i, int size) : first(2 * i) {
    if (size == 1) return;
    const int m = size / 2;
    count = size % 2 == 0 ? 2 : 3;
    const auto whole = static_cast<float>(size);
    if (count == 2) {
      parts[0] = parts[1] = 0.5f;
    } else {
      parts[0] = static_cast<float>(m - i) / whole;
      parts[1] = static_cast<float>(m) / whole;
      parts[2] = static_cast<float>(i + 1) / whole;
    }
  }
};

/// The mean of the texels. Where alpha says how much of a colour is there, it weighs the colours, so that
/// what cannot be seen does not bleed into what can; where nothing is there, all count alike.
template <class Read>
vec4 mean_of(const Read& read, const Footprint& columns, const Footprint& rows, bool weigh) {
  vec4 plain(0);
  vec3 weighed(0);
  for (int y = 0; y < rows.count; ++y)
    for (int x = 0; x < columns.count; ++x) {
      const vec4 texel = read(columns.first + x, rows.first + y);
      const vec4 share = texel * (columns.parts[x] * rows.parts[y]);
      plain = plain + share;
      if (weigh) weighed = weighed + vec3(share) * texel.w;
    }
  return weigh && plain.w > 0 ? vec4(weighed / plain.w, plain.w) : plain;
}

/// The same of 2×2 texels that need no weighing: most of the work.
template <class Read>
vec4 mean_of_four(const Read& read, int x, int y) {
  return (read(x, y) * 0.25f + read(x + 1, y) * 0.25f) +
         (read(x, y + 1) * 0.25f + read(x + 1, y + 1) * 0.25f);
}

/// One level of means: give(i, mean) for every texel i.
template <class Read, class Give>
void halve(int width, int height, bool weigh, const Read& read, const Give& give) {
  const int columns = std::max(1, width / 2), rows = std::max(1, height / 2);
  const bool four = !weigh && width % 2 == 0 && height % 2 == 0;
  std::vector<Footprint> footprints;
  for (int x = 0; x < columns && !four; ++x) footprints.emplace_back(x, width);
  const auto grain = static_cast<std::size_t>(std::max(1, 4096 / columns));
  tbb::parallel_for(tbb::blocked_range<int>(0, rows, grain), [&](const tbb::blocked_range<int>& range) {
    for (int y = range.begin(); y != range.end(); ++y) {
      const Footprint row(y, height);
      std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(columns);
      for (int x = 0; x < columns; ++x, ++i)
        give(i, four ? mean_of_four(read, 2 * x, 2 * y)
                     : mean_of(read, footprints[static_cast<std::size_t>(x)], row, weigh));
    }
  });
}

std::size_t area(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

/// Fills in the levels below the first. Means are taken of means in floats, and what is stored in bytes is
/// rounded once, not once a level.
void add_levels(Texture& texture) {
  const TextureLevel& base = texture.levels[0];
  const bool in_bytes = !base.bytes.empty();
  const bool weigh = texture.use == TextureUse::colour && texture.has_alpha;
  const Bytes bytes{.colour = texture.use == TextureUse::colour};
  std::vector<vec4> above;  // the last level, unrounded, where bytes are stored
  while (texture.levels.back().width > 1 || texture.levels.back().height > 1) {
    const std::size_t number = texture.levels.size();
    const int width = texture.levels.back().width, height = texture.levels.back().height;
    texture.levels.push_back({std::max(1, width / 2), std::max(1, height / 2), {}, {}});
    const TextureLevel& from = texture.levels[number - 1];
    TextureLevel& to = texture.levels[number];
    const std::size_t count = area(to.width, to.height);
    const auto at = [width](int x, int y) {
      return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    };
    if (!in_bytes) {
      to.floats.resize(count);
      halve(
          width, height, weigh, [&](int x, int y) { return from.floats[at(x, y)]; },
          [&](std::size_t i, const vec4& mean) { to.floats[i] = mean; });
      continue;
    }
    to.bytes.resize(count);
    std::vector<vec4> means(count);
    const auto give = [&](std::size_t i, const vec4& mean) {
      means[i] = mean;
      to.bytes[i] = bytes.written(mean);
    };
    if (number == 1)
      halve(
          width, height, weigh, [&](int x, int y) { return bytes.read(from.bytes[at(x, y)]); }, give);
    else
      halve(
          width, height, weigh, [&](int x, int y) { return above[at(x, y)]; }, give);
    above = std::move(means);
  }
}

// ---- images ----

/// What the levels take, also where they are not filled in.
std::uint64_t bytes_of(const Texture& texture) {
  std::uint64_t texels = 0;
  for (const TextureLevel& level : texture.levels) texels += area(level.width, level.height);
  return texels * (texture.levels.empty() || texture.levels[0].floats.empty() ? 4 : 16);
}

/// What a texture of that size takes with its chain.
std::uint64_t bytes_of_chain(long long width, long long height, std::uint64_t bytes_a_texel) {
  std::uint64_t texels = 0;
  for (; width > 1 || height > 1; width = std::max(1ll, width / 2), height = std::max(1ll, height / 2))
    texels += static_cast<std::uint64_t>(width * height);
  return (texels + 1) * bytes_a_texel;
}

std::string in_mebibytes(std::uint64_t bytes) {
  return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB";
}

/// Takes an image as the largest level of a texture, within the limits.
class Texels : public ImageSink {
 public:
  Texels(const std::string& label, Texture& texture, const std::function<void(std::uint64_t)>& check_bytes)
      : label_(label), texture_(texture), check_bytes_(check_bytes) {}

  void begin(const ImageHeader& header) override {
    check(header);
    colour_ = texture_.use == TextureUse::colour;
    to_straight_ = colour_ && header.premultiplied;
    texture_.levels = {{static_cast<int>(header.width), static_cast<int>(header.height), {}, {}}};
  }

  void row(const u8vec4* texels) override {
    TextureLevel& level = with_room(&TextureLevel::bytes);
    level.bytes.insert(level.bytes.end(), texels, texels + level.width);
  }

  void row(const u16vec4* texels) override {
    static const std::vector<float> light = [] {
      std::vector<float> result(65536);
      for (std::size_t i = 0; i < result.size(); ++i) result[i] = srgb_decoded(static_cast<float>(i) / 65535);
      return result;
    }();
    TextureLevel& level = with_room(&TextureLevel::floats);
    for (int x = 0; x < level.width; ++x) {
      vec4 texel = vec4(texels[x]) / 65535.0f;
      for (int c = 0; c < 3 && colour_; ++c) texel[c] = light[texels[x][c]];
      level.floats.push_back(texel);
    }
  }

  void row(const vec4* texels) override {
    TextureLevel& level = with_room(&TextureLevel::floats);
    for (int x = 0; x < level.width; ++x) {
      vec4 texel = texels[x];
      if (to_straight_ && texel.w > 0 && texel.w < 1) texel = vec4(vec3(texel) / texel.w, texel.w);
      for (int c = 0; c < 4; ++c)
        if (!(std::fabs(texel[c]) <= most_light))
          refuse("it holds, divided by alpha, what is no number or lies beyond 1e30; write finite colours");
      texel.w = std::clamp(texel.w, 0.0f, 1.0f);
      level.floats.push_back(texel);
    }
  }

 private:
  /// The level, with room for all of its texels: when the first row is decoded, and not on a header's word.
  template <class T>
  TextureLevel& with_room(std::vector<T> TextureLevel::*texels) {
    TextureLevel& level = texture_.levels[0];
    if ((level.*texels).empty()) (level.*texels).reserve(area(level.width, level.height));
    return level;
  }

  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(label_ + " cannot be read: " + what);
  }

  void check(const ImageHeader& header) const {
    const std::string size = std::to_string(header.width) + "x" + std::to_string(header.height);
    const auto within = [&](long long limit) { return header.width * header.height <= limit; };
    if (header.width < 1 || header.height < 1 || header.width > most_side || header.height > most_side ||
        !within(most_texels))
      refuse("a texture of " + size + " texels is refused; each side goes from 1 to " +
             std::to_string(most_side) + ", both together to " + std::to_string(most_texels) + " texels");
    const long long bytes_a_texel = header.depth == ImageHeader::Depth::bytes ? 4 : 16;
    const auto file_bytes = static_cast<long long>(header.file_bytes);
    const long long most = 4 * ((1ll << 20) + 1024 * file_bytes) / bytes_a_texel;
    if (!within(most))
      refuse("a texture of " + size + " texels from " + std::to_string(file_bytes) + " bytes is refused; " +
             std::to_string(most) + " texels are the most that such a file may have");
    check_bytes_(bytes_of_chain(header.width, header.height, static_cast<std::uint64_t>(bytes_a_texel)));
  }

  const std::string& label_;
  Texture& texture_;
  const std::function<void(std::uint64_t)>& check_bytes_;
  bool colour_ = false, to_straight_ = false;
};

bool not_opaque(const TextureLevel& level) {
  return std::any_of(level.bytes.begin(), level.bytes.end(), [](const u8vec4& t) { return t.w != 255; }) ||
         std::any_of(level.floats.begin(), level.floats.end(), [](const vec4& t) { return t.w != 1; });
}

/// The texture in those bytes, with its chain. `check` is asked whether there may be so many bytes of it.
Texture decoded(const std::string& label, std::string_view bytes, TextureUse use,
                const std::function<void(std::uint64_t, const Texture&)>& check) {
  Texture texture;
  texture.use = use;
  texture.file_bytes = bytes.size();
  texture.file_hash = std::hash<std::string_view>()(bytes);
  const std::function<void(std::uint64_t)> check_bytes = [&](std::uint64_t more) { check(more, texture); };
  Texels texels(label, texture, check_bytes);
  decode(label, bytes, texels);
  texture.has_alpha = not_opaque(texture.levels[0]);
  add_levels(texture);
  return texture;
}

/// What nobody takes for a picture. It is small, since a file may name any number that are not there.
Texture missing_texture(TextureUse use) {
  constexpr int side = 8;
  std::vector<u8vec4> texels;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      texels.push_back((x + y) % 2 == 0 ? u8vec4(255, 0, 255, 255) : u8vec4(0, 0, 0, 255));
  Texture texture = make_texture("", side, side, std::move(texels), use);
  texture.missing = true;
  return texture;
}

}  // namespace

std::size_t Texture::bytes() const {
  std::size_t sum = 0;
  for (const TextureLevel& level : levels)
    sum += level.bytes.size() * sizeof(u8vec4) + level.floats.size() * sizeof(vec4);
  return sum;
}

vec4 texel(const Texture& texture, int level, int x, int y) {
  const TextureLevel& l = texture.levels[static_cast<std::size_t>(level)];
  const auto at =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(l.width) + static_cast<std::size_t>(x);
  if (l.bytes.empty()) return l.floats[at];
  const u8vec4 bytes = l.bytes[at];
  vec4 result = vec4(bytes) / 255.0f;
  for (int c = 0; c < 3 && texture.use == TextureUse::colour; ++c) result[c] = light_of_byte()[bytes[c]];
  return result;
}

vec4 mean(const Texture& texture) {
  return texel(texture, static_cast<int>(texture.levels.size()) - 1, 0, 0);
}

Texture make_texture(std::string name, int width, int height, std::vector<u8vec4> texels, TextureUse use) {
  Texture texture;
  texture.name = std::move(name);
  texture.use = use;
  texture.levels.push_back({width, height, std::move(texels), {}});
  texture.has_alpha = not_opaque(texture.levels[0]);
  add_levels(texture);
  return texture;
}

void TextureSet::check_bytes(const std::string& what, std::uint64_t more, const Texture& of) {
  for (; counted_ < scene_.textures.size(); ++counted_) {
    const Texture& texture = scene_.textures[counted_];
    const std::uint64_t bytes = bytes_of(texture);
    bytes_.all += bytes;
    if (texture.file_bytes == 0) continue;
    bytes_.from_files += bytes;
    if (bytes_.files.emplace(texture.file_bytes, texture.file_hash).second)
      bytes_.of_files += texture.file_bytes;
  }
  if (bytes_.all + more > most_bytes)
    throw InputError(what + " the textures of the scene would take " + in_mebibytes(bytes_.all + more) +
                     "; " + in_mebibytes(most_bytes) + " are the most; name fewer or smaller images");
  const std::uint64_t from_files = bytes_.from_files + (of.file_bytes > 0 ? more : 0);
  const bool is_new = !bytes_.files.contains({of.file_bytes, of.file_hash});
  const std::uint64_t of_files = bytes_.of_files + (is_new ? of.file_bytes : 0);
  const std::uint64_t most = most_bytes_of_nothing + most_ratio * of_files;
  if (from_files > most)
    throw InputError(what + " the textures of the scene would take " + in_mebibytes(from_files) + " from " +
                     std::to_string(of_files) + " bytes of images; " + in_mebibytes(most) +
                     " are the most for these; name fewer or smaller images");
}

void TextureSet::check_bytes(const std::string& path, std::size_t line) {
  check_bytes(printable(path) + (line == 0 ? "" : ":" + std::to_string(line)) + ": with what it brings", 0,
              {});
}

void TextureSet::warn_of_missing(const std::string& image, const std::string& text) {
  if (!missing_.insert(image).second) return;
  if (missing_.size() <= most_named) {
    scene_.warnings.push_back(text + " not found; magenta and black squares stand for it");
    return;
  }
  // Others may have added to the warnings since, and taken them elsewhere.
  std::vector<std::string>& warnings = scene_.warnings;
  const bool is_there = missing_.size() > most_named + 1 && many_missing_at_ < warnings.size() &&
                        warnings[many_missing_at_] == many_missing_;
  if (is_there) warnings.erase(warnings.begin() + static_cast<std::ptrdiff_t>(many_missing_at_));
  const std::size_t more = missing_.size() - most_named;
  many_missing_ = "and " + std::to_string(more) + (more == 1 ? " more image" : " more images") + " not found";
  many_missing_at_ = warnings.size();
  warnings.push_back(many_missing_);
}

std::int32_t TextureSet::number(const std::string& image, const std::string& label, const How& how,
                                const std::function<Texture()>& make) {
  const auto digit = [](auto choice) { return static_cast<char>('0' + static_cast<int>(choice)); };
  const std::string use = image + '\0' + digit(how.use);
  const std::string key = use + digit(how.wrap_u) + digit(how.wrap_v);
  const auto found = numbers_.lower_bound(use);
  const bool is_decoded = found != numbers_.end() && found->first.starts_with(use);
  if (const auto same = numbers_.find(key); same != numbers_.end()) return same->second;
  Texture texture;
  if (is_decoded) {  // and differs in what lies beyond its edges alone
    const Texture& same = scene_.textures[static_cast<std::size_t>(found->second)];
    check_bytes(label + " cannot be read: with it", bytes_of(same), same);
    texture = same;
  } else {
    texture = make();
  }
  texture.wrap_u = how.wrap_u;
  texture.wrap_v = how.wrap_v;
  const auto result = static_cast<std::int32_t>(scene_.textures.size());
  scene_.textures.push_back(std::move(texture));
  numbers_.emplace(key, result);
  return result;
}

std::int32_t TextureSet::left_out(const std::string& image) {
  scene_.images_not_read += left_out_.insert(image).second;
  return -1;
}

std::int32_t TextureSet::add(const fs::path& file, const How& how, const std::string& path,
                             std::size_t line) {
  if (!options_.textures) return left_out(file.string());
  const std::string label = printable(file.string()) + ":";
  const auto check = [&](std::uint64_t more, const Texture& of) {
    check_bytes(label + " cannot be read: with it", more, of);
  };
  std::error_code error;
  fs::path whole = fs::weakly_canonical(file, error);
  if (error) whole = file.lexically_normal();
  const std::string image = whole.string();
  return number(image, label, how, [&] {
    const fs::file_status status = fs::status(file, error);
    const bool missing = status.type() == fs::file_type::not_found;
    if (missing)
      warn_of_missing(image, printable(path) + (line == 0 ? "" : ":" + std::to_string(line)) + ": " +
                                 in_quotes(file.filename().string()));
    if (!missing && fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status))
      throw InputError(label + " cannot be read: it is not a regular file; save the image to one");
    Texture texture =
        missing ? missing_texture(how.use) : decoded(label, image_bytes(file.string()), how.use, check);
    texture.name = file.filename().string();
    return texture;
  });
}

std::int32_t TextureSet::add(const std::string& name, std::string_view encoded, const How& how,
                             const std::string& path, std::size_t line) {
  if (!options_.textures) return left_out(name);
  const std::string label =
      printable(path) + (line == 0 ? "" : ":" + std::to_string(line)) + ": image " + in_quotes(name);
  const auto check = [&](std::uint64_t more, const Texture& of) {
    check_bytes(label + " cannot be read: with it", more, of);
  };
  return number(path + '\0' + '#' + name, label, how, [&] {
    Texture texture = decoded(label, encoded, how.use, check);
    texture.name = name;
    return texture;
  });
}

}  // namespace trilha
