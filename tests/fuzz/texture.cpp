// Images as textures: the limits, and what holds of every chain. The first byte says for which use.

#include <cmath>

#include "common/scene/scene.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace trilha;

void check(const Texture& texture) {
  const auto wanted = [](bool holds) {
    if (!holds) std::abort();
  };
  wanted(!texture.levels.empty() && texture.levels.back().width == 1 && texture.levels.back().height == 1);
  for (std::size_t k = 0; k < texture.levels.size(); ++k) {
    const TextureLevel& level = texture.levels[k];
    if (k > 0) {
      const TextureLevel& above = texture.levels[k - 1];
      wanted(level.width == std::max(1, above.width / 2) && level.height == std::max(1, above.height / 2));
      wanted(level.bytes.empty() == above.bytes.empty());
    }
    const std::size_t texels = static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height);
    wanted((level.bytes.empty() ? level.floats.size() : level.bytes.size()) == texels);
    wanted(level.bytes.empty() || level.floats.empty());
    for (const vec4& t : level.floats) {
      for (int c = 0; c < 4; ++c) wanted(std::isfinite(t[c]));
      wanted(t.w >= 0 && t.w <= 1.0001f);
    }
    if (!texture.has_alpha)
      for (const u8vec4& t : level.bytes) wanted(t.w == 255);
  }
  const vec4 whole = mean(texture);
  wanted(std::isfinite(whole.x + whole.y + whole.z + whole.w));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const TextureUse use = data[0] % 2 == 0 ? TextureUse::colour : TextureUse::data;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  return fuzz::reads_or_refuses("scene.glb:1", [&](const std::string&) {
    Scene scene;
    const LoadOptions options;
    TextureSet set(scene, options);
    const std::int32_t number = set.add("image", bytes, {use, Wrap::repeat, Wrap::clamp}, "scene.glb", 1);
    check(scene.textures.at(static_cast<std::size_t>(number)));
  });
}
