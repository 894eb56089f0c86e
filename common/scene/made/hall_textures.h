#pragma once
// The textures of the made hall, worked out texel by texel: the same bits on every machine.

#include <cstdint>
#include <vector>

#include "common/scene/texture.h"

namespace trilha {

/// What the hall is made of. `period` is how many metres one repetition covers, along u and along v.
enum class HallTexture : std::uint8_t {
  limestone,
  ashlar,
  flagstone,
  plaster,
  starry_vault,
  voussoir,
  red_marble,
  white_marble,
  nave_floor,
  aisle_floor,
  azulejo,
  mosaic,
  wood,
  cloth,
  grille,
  roof_tiles
};
constexpr int hall_texture_count = 16;

struct HallTextureFacts {
  const char* name;
  vec2 period;       ///< metres
  bool has_normals;  ///< a normal map is worth its texels
};
const HallTextureFacts& facts(HallTexture which);

/// size × size texels that tile: colours in the encoding of a screen, with alpha, and the normal map of the
/// same surface, empty where it has none.
struct HallTexels {
  std::vector<u8vec4> colours, normals;
};
HallTexels hall_texels(HallTexture which, int size);

/// The heights of the same surface, for bump maps: grey, from 0 where it is lowest to 255 where it is
/// highest, which is `range` metres above.
struct HallHeights {
  std::vector<u8vec4> texels;
  float range = 0;
};
HallHeights hall_heights(HallTexture which, int size);

/// About the mean of the colours in linear light, for materials that go without textures.
vec3 hall_mean_colour(HallTexture which);

}  // namespace trilha
