#include "chapters/02_whitted/textures.h"

#include <stdexcept>

namespace trilha {

std::vector<bool> wanted_textures(const Scene& scene, const WantedMaps& maps) {
  std::vector<bool> wanted(scene.textures.size(), false);
  for (const Material& m : scene.materials) {
    const auto add = [&](bool is_wanted, const Map& map) {
      if (is_wanted && map && static_cast<std::size_t>(map.texture) < wanted.size())
        wanted[static_cast<std::size_t>(map.texture)] = true;
    };
    add(maps.diffuse, m.diffuse_map);
    add(maps.specular, m.specular_map);
    add(maps.emission, m.emission_map);
    add(maps.normal, m.normal_map);
    add(maps.bump, m.bump_map);
    add(maps.opacity, m.opacity_map);
    add(maps.roughness, m.roughness_map);
    add(maps.metallic, m.metallic_map);
  }
  return wanted;
}

SceneTextures::SceneTextures(const Scene& scene, const Stream& stream, const std::vector<bool>& wanted,
                             bool mip_levels) {
  if (wanted.size() != scene.textures.size())
    throw std::logic_error("one answer a texture says which are wanted");
  std::vector<TextureView> textures(scene.textures.size());
  std::vector<TextureLevelView> levels;
  std::vector<const TextureLevel*> sources;
  std::uint64_t bytes = 0, floats = 0;
  for (std::size_t i = 0; i < textures.size(); ++i) {
    const Texture& from = scene.textures[i];
    if (!wanted[i] || from.levels.empty()) continue;
    TextureView& to = textures[i];
    to.first_level = static_cast<std::uint32_t>(levels.size());
    to.levels = mip_levels ? static_cast<std::int32_t>(from.levels.size()) : 1;
    to.wrap_u = from.wrap_u;
    to.wrap_v = from.wrap_v;
    to.in_floats = from.levels[0].bytes.empty();
    to.colour = from.use == TextureUse::colour;
    to.has_alpha = from.has_alpha;
    to.weighed = to.colour && to.has_alpha;
    for (std::int32_t k = 0; k < to.levels; ++k) {
      const TextureLevel& level = from.levels[static_cast<std::size_t>(k)];
      const std::size_t there = to.in_floats ? level.floats.size() : level.bytes.size();
      const auto is_side = [](int side) { return side > 0 && side <= most_texture_side; };
      const bool has_sides = is_side(level.width) && is_side(level.height);
      const std::uint64_t area =
          has_sides ? static_cast<std::uint64_t>(level.width) * static_cast<std::uint64_t>(level.height) : 0;
      if (area == 0 || there != area)
        throw std::logic_error("level " + std::to_string(k) + " of texture " + std::to_string(i) + " has " +
                               std::to_string(there) + " texels, but sides of " +
                               std::to_string(level.width) + " and " + std::to_string(level.height));
      std::uint64_t& end = to.in_floats ? floats : bytes;
      levels.push_back({end, level.width, level.height});
      sources.push_back(&level);
      end += area;
    }
  }
  if (levels.empty()) return;  // no texture, not even a table

  // Level by level from where the texels are: a second copy on the host could be two gigabytes.
  const Backend backend = stream.backend();
  bytes_ = Buffer<u8vec4>(backend, bytes);
  floats_ = Buffer<vec4>(backend, floats);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const TextureLevel& from = *sources[i];
    if (from.bytes.empty())
      copy(floats_.data() + levels[i].first, backend, from.floats.data(), Backend::cpu,
           from.floats.size() * sizeof(vec4), stream);
    else
      copy(bytes_.data() + levels[i].first, backend, from.bytes.data(), Backend::cpu,
           from.bytes.size() * sizeof(u8vec4), stream);
  }
  levels_ = Buffer<TextureLevelView>(stream, levels);
  textures_ = Buffer<TextureView>(stream, textures);

  std::vector<float> of_byte(512);
  for (std::size_t i = 0; i < 256; ++i) {
    of_byte[i] = static_cast<float>(i) / 255.0f;
    of_byte[256 + i] = srgb_decoded(of_byte[i]);
  }
  of_byte_ = Buffer<float>(stream, of_byte);
}

TexturesView SceneTextures::view() const {
  return {bytes_.data(),    floats_.data(),  levels_.data(),
          textures_.data(), of_byte_.data(), static_cast<std::uint32_t>(textures_.size())};
}

std::size_t SceneTextures::bytes() const {
  return bytes_.bytes() + floats_.bytes() + levels_.bytes() + textures_.bytes() + of_byte_.bytes();
}

}  // namespace trilha
