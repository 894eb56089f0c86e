#include "common/scene/texture.h"

#include "common/scene/scene.h"

namespace trilha {

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
  vec4 result = vec4(l.bytes[at]) / 255.0f;
  for (int c = 0; c < 3 && texture.use == TextureUse::colour; ++c) result[c] = srgb_decoded(result[c]);
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
  return texture;
}

std::int32_t TextureSet::add(const std::filesystem::path&, const How&, const std::string&, std::size_t) {
  return -1;
}

std::int32_t TextureSet::add(const std::string&, std::string_view, const How&, const std::string&,
                             std::size_t) {
  return -1;
}

}  // namespace trilha
