#pragma once
// Textures: from a point of a surface to a number of an image, with the same bits on both machines. Read from
// top to bottom: the views that passes hold, a coordinate into the image, texels, the three filters, the maps
// of materials, how large the footprint of a ray is in texels, coordinates for spheres and planes, and what
// is uploaded. bump_maps.h makes normals of it.
//
// No filter of a graphics processor is used: its weights have eight bits, and the CPU has none.

#include <cstring>
#include <vector>

#include "chapters/02_whitted/surface_point.h"
#include "common/math/precision.h"
#include "common/parallel/buffer.h"
#include "common/scene/scene.h"

namespace trilha {

/// What a texture is between its texels: the nearest one; the mean of the nearest four, weighed by how near
/// they are; the same in the two levels of the mip chain whose texels are nearest to the footprint's size,
/// and the mean of both (Williams 1983). The first two look at the largest level alone.
enum class TextureFilter { nearest, bilinear, trilinear };
constexpr TextureFilter all_texture_filters[] = {TextureFilter::nearest, TextureFilter::bilinear,
                                                 TextureFilter::trilinear};
/// Its name as the settings have it.
inline const char* name(TextureFilter filter) {
  constexpr const char* names[] = {"nearest", "bilinear", "trilinear"};
  return names[static_cast<int>(filter)];
}

// ---- views -------------------------------------------------------------------

/// The longest side of a texture: up to here, texels and halves of them are floats.
constexpr std::int32_t most_texture_side = 1 << 23;

/// Where the texels of a level begin in the array that holds them: row by row from the top.
struct TextureLevelView {
  std::uint64_t first = 0;
  std::int32_t width = 1, height = 1;
};

struct TextureView {
  std::uint32_t first_level = 0;  ///< in TexturesView::levels
  std::int32_t levels = 0;        ///< 0: it is not there
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  bool in_floats = false;
  bool colour = false;     ///< its bytes are encoded as sRGB
  bool weighed = false;    ///< alpha weighs its colours
  bool has_alpha = false;  ///< a texel is not opaque
};

/// All textures of a scene that are there, for passes.
struct TexturesView {
  const u8vec4* bytes = nullptr;
  const vec4* floats = nullptr;
  const TextureLevelView* levels = nullptr;
  const TextureView* textures = nullptr;  ///< one a texture of the scene
  const float* of_byte = nullptr;         ///< what bytes mean: 256 of data, then 256 of colours, as light
  std::uint32_t count = 0;

  /// Is there such a texture? False for every number that is none.
  TRILHA_HD bool has(std::int32_t texture) const {
    return static_cast<std::uint32_t>(texture) < count && textures[texture].levels > 0;
  }
};

// ---- a coordinate into the image -----------------------------------------------

/// The coordinate in [0, 1] that the image shows at u. Infinity stays at its end where it is clamped; else it
/// becomes 0, as NaN does.
TRILHA_HD inline float wrapped(float u, Wrap wrap) {
  float inside = u;
  if (wrap == Wrap::repeat) {
    inside = u - std::floor(u);
  } else if (wrap == Wrap::mirror) {
    const float twice = u - 2.0f * std::floor(0.5f * u);
    inside = twice > 1.0f ? 2.0f - twice : twice;
  }
  return inside > 0.0f ? min(inside, 1.0f) : 0.0f;
}

/// The two texels of a row between whose centres a coordinate lies, and the part that the second has, in
/// [0, 1]. Centres lie at half integers.
struct Neighbours {
  std::int32_t first, second;
  float part;
};
TRILHA_HD inline Neighbours neighbours(float inside, std::int32_t size, Wrap wrap) {
  const float x = fma(inside, static_cast<float>(size), -0.5f), below = std::floor(x);
  const std::int32_t i = min(static_cast<std::int32_t>(below), size - 1);  // from −1
  const bool repeats = wrap == Wrap::repeat;  // at a mirror, what lies beyond an edge is the edge
  return {i >= 0 ? i : (repeats ? size - 1 : 0), i + 1 < size ? i + 1 : (repeats ? 0 : size - 1), x - below};
}

/// The texel that a coordinate lies in.
TRILHA_HD inline std::int32_t nearest(float inside, std::int32_t size) {
  return min(static_cast<std::int32_t>(inside * static_cast<float>(size)), size - 1);
}

// ---- texels and their means ----------------------------------------------------

/// The texel of column x and of row y, counted from below, in linear light: the bits of texel(Texture).
TRILHA_HD inline vec4 texel(const TexturesView& view, const TextureView& texture,
                            const TextureLevelView& level, std::int32_t x, std::int32_t y) {
  const std::uint64_t row = static_cast<std::uint64_t>(level.height - 1 - y);
  const std::uint64_t at =
      level.first + row * static_cast<std::uint64_t>(level.width) + static_cast<std::uint64_t>(x);
  if (texture.in_floats) return view.floats[at];
  const u8vec4 bytes = view.bytes[at];
  const float* meaning = view.of_byte + (texture.colour ? 256 : 0);
  return {meaning[bytes.x], meaning[bytes.y], meaning[bytes.z], view.of_byte[bytes.w]};
}

/// (1 − t)·a + t·b for t in [0, 1]: a where t = 0, b where t = 1, their value where they are equal, and never
/// beyond either. Starts from the nearer one: t·(b − a) is then rounded to no more than half the distance
/// (and a step from the wrong end would lose b where |a| is far larger).
TRILHA_HD inline float blended(float a, float b, float t) {
  return t < 0.5f ? fma(t, b - a, a) : fma(1.0f - t, a - b, b);
}

/// The same of texels. Where alpha weighs, it says how much of a colour is there: a colour that cannot be
/// seen bleeds into none that can, as in the mip chain. Means of means stay right: what counts is Σwαc/Σwα of
/// all texels, of their weights w; where nothing is there, it is Σwc.
TRILHA_HD inline vec4 blended(const vec4& a, const vec4& b, float t, bool weighed) {
  const float alpha = blended(a.w, b.w, t);
  const float part = weighed && alpha > 0.0f ? min(t * b.w / alpha, 1.0f) : t;
  return {blended(a.x, b.x, part), blended(a.y, b.y, part), blended(a.z, b.z, part), alpha};
}

// ---- the filters ---------------------------------------------------------------

/// The mean of the nearest four texels of a level, each weighed by the area that a square of a texel's size
/// around the point has of it.
TRILHA_HD inline vec4 bilinear(const TexturesView& view, const TextureView& texture, std::int32_t number,
                               float u, float v) {
  const TextureLevelView level = view.levels[texture.first_level + static_cast<std::uint32_t>(number)];
  const Neighbours x = neighbours(u, level.width, texture.wrap_u);
  const Neighbours y = neighbours(v, level.height, texture.wrap_v);
  const vec4 below = blended(texel(view, texture, level, x.first, y.first),
                             texel(view, texture, level, x.second, y.first), x.part, texture.weighed);
  const vec4 above = blended(texel(view, texture, level, x.first, y.second),
                             texel(view, texture, level, x.second, y.second), x.part, texture.weighed);
  return blended(below, above, y.part, texture.weighed);
}

/// The two levels on whose sides a level of the chain lies, 0 for NaN, and the part of the second.
TRILHA_HD inline Neighbours levels_around(const TextureView& texture, float level) {
  const std::int32_t last = texture.levels - 1;
  const float within = level > 0.0f ? min(level, static_cast<float>(last)) : 0.0f;
  const std::int32_t i = static_cast<std::int32_t>(within);
  return {i, min(i + 1, last), within - static_cast<float>(i)};
}

/// The texture at uv, (0, 0) the lower left corner of the image and (1, 1) its upper right one: colours in
/// linear light, not multiplied with alpha. Trilinear looks at `level` of the chain, 0 the largest; others
/// ignore it. Any uv and level will do, NaN and infinity too. White where there is no such texture.
///
/// A constant texture gives its texel to the last bit. Each mean of two is the exact one with the same t, to
/// three roundings of the larger, and between the two: so is the result between the least and the greatest
/// texel. t itself is rounded to a 2²⁴th of the image, and of u.
TRILHA_HD inline vec4 sampled(const TexturesView& view, std::int32_t number, TextureFilter filter, vec2 uv,
                              float level) {
  if (!view.has(number)) return vec4(1);
  const TextureView texture = view.textures[number];
  const float u = wrapped(uv.x, texture.wrap_u), v = wrapped(uv.y, texture.wrap_v);
  if (filter == TextureFilter::nearest) {
    const TextureLevelView largest = view.levels[texture.first_level];
    return texel(view, texture, largest, nearest(u, largest.width), nearest(v, largest.height));
  }
  if (filter == TextureFilter::bilinear) return bilinear(view, texture, 0, u, v);
  const Neighbours levels = levels_around(texture, level);
  const vec4 finer = bilinear(view, texture, levels.first, u, v);
  if (!(levels.part > 0.0f)) return finer;
  return blended(finer, bilinear(view, texture, levels.second, u, v), levels.part, texture.weighed);
}

// ---- the maps of materials -----------------------------------------------------

static_assert(std::is_trivially_copyable_v<Map>, "passes hold maps");

/// Where a map looks, at uv of the surface.
TRILHA_HD inline vec2 coordinates(const Map& map, vec2 uv) {
  return {fma(map.scale.x, uv.x, map.offset.x), fma(map.scale.y, uv.y, map.offset.y)};
}

/// What a map says at uv of the surface: 1 where there is none, so that it can be multiplied with.
TRILHA_HD inline vec4 map_value(const TexturesView& view, const Map& map, TextureFilter filter, vec2 uv,
                                float level) {
  return sampled(view, map.texture, filter, coordinates(map, uv), level);
}

/// The same of a map of single numbers: its channel.
TRILHA_HD inline float map_number(const TexturesView& view, const Map& map, TextureFilter filter, vec2 uv,
                                  float level) {
  const vec4 value = map_value(view, map, filter, uv, level);
  return map.channel <= 0 ? value.x : map.channel == 1 ? value.y : map.channel == 2 ? value.z : value.w;
}

// ---- how large a footprint is --------------------------------------------------

/// log₂ of a footprint's width in texels, which is the level of the chain whose texels are as wide: to 2e-4,
/// exact at powers of two, and growing with its argument. From −126, which is the answer to what is 0, less
/// or NaN too, to 128. log₂(1 + m) is m + m(1 − m)·q(m), where q is the minimax parabola.
TRILHA_HD inline float texture_level(float texels) {
  const float least = 0x1p-126f, most = std::numeric_limits<float>::max();
  const float x = texels > least ? min(texels, most) : least;
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const float exponent = static_cast<float>(static_cast<std::int32_t>(bits >> 23) - 127);
  bits = (bits & 0x7fffffu) | 0x3f800000u;
  float m;
  std::memcpy(&m, &bits, sizeof m);
  m -= 1.0f;
  const float q = fma(fma(0.0821307f, m, -0.239058245f), m, 0.438725742f);
  return exponent + fma(m * (1.0f - m), q, m);
}

/// The level at which a map is looked up where a footprint is that wide in texture coordinates of the
/// surface.
TRILHA_HD inline float map_level(const TexturesView& view, const Map& map, float footprint) {
  if (!view.has(map.texture)) return 0;
  const TextureLevelView finest = view.levels[view.textures[map.texture].first_level];
  const float across = std::sqrt(std::fabs(map.scale.x) * static_cast<float>(finest.width));
  const float up = std::sqrt(std::fabs(map.scale.y) * static_cast<float>(finest.height));
  return texture_level(footprint * across * up);
}

/// The larger |component|.
template <class T>
TRILHA_HD inline T largest(const Vec2<T>& v) {
  return max(std::fabs(v.x), std::fabs(v.y));
}

/// Makes the vector one of length one. False, and what is left has no meaning, where it has no direction.
template <class T>
TRILHA_HD inline bool normalise(Vec3<T>& v) {
  const T size = largest(v);
  if (!is_normal(size)) return false;
  v = v / size;
  const T length = std::sqrt(fused_dot(v, v));
  v = v / length;
  return is_normal(length);  // false for NaN
}

/// Edges of a triangle and of its image in texture coordinates, each pair divided by its largest number, so
/// that no product of them leaves the scalar's range.
template <class T>
struct ScaledTriangle {
  Vec3<T> e1, e2, normal;  ///< normal = e1×e2, its length normal_length
  Vec2<T> d1, d2;
  T normal_length, determinant;  ///< d1×d2
  T scale;                       ///< texture coordinates for a unit of length: the two divisors' quotient
  bool valid;                    ///< both have an area, and numbers that are finite
};
template <class T>
TRILHA_HD inline ScaledTriangle<T> scaled_triangle(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c,
                                                   const Vec2<T>& uva, const Vec2<T>& uvb,
                                                   const Vec2<T>& uvc) {
  ScaledTriangle<T> s;
  s.e1 = b - a;
  s.e2 = c - a;
  s.d1 = uvb - uva;
  s.d2 = uvc - uva;
  const T size = max(largest(s.e1), largest(s.e2));
  const T size_uv = max(largest(s.d1), largest(s.d2));
  s.valid = is_normal(size) && is_normal(size_uv);
  if (!s.valid) return s;
  s.e1 = s.e1 / size;
  s.e2 = s.e2 / size;
  s.d1 = s.d1 / size_uv;
  s.d2 = s.d2 / size_uv;
  s.scale = size_uv / size;
  s.normal = exact_cross(s.e1, s.e2);
  s.determinant = difference_of_products(s.d1.x, s.d2.y, s.d2.x, s.d1.y);
  const T thickest = largest(s.normal);
  const Vec3<T> n = s.normal / thickest;
  s.normal_length = thickest * std::sqrt(fused_dot(n, n));
  s.valid = is_normal(s.normal_length) && is_normal(s.determinant) && s.scale > 0;
  return s;
}

/// How many texture coordinates a unit of length holds on a triangle, in the mean over all directions: the
/// square root of its area in the texture over its area in the world. Times a footprint's width it is the
/// footprint's width in texture coordinates. 0 where either has no area or a number is not finite; never
/// infinite.
template <class T>
TRILHA_HD inline T uv_density(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, const Vec2<T>& uva,
                              const Vec2<T>& uvb, const Vec2<T>& uvc) {
  const ScaledTriangle<T> s = scaled_triangle(a, b, c, uva, uvb, uvc);
  if (!s.valid) return 0;
  const T density = s.scale * std::sqrt(std::fabs(s.determinant) / s.normal_length);
  return min(density, std::numeric_limits<T>::max());
}

// ---- coordinates for spheres and planes ----------------------------------------

/// The angle of (x, y) from the x axis in turns, in [−½, ½], 0 for (0, 0): to 4e-8 of a turn and three
/// roundings. atan r/(2πr) is a polynomial in r² for r in [0, 1] (minimax in atan r); the octants are mirror
/// images of each other.
template <class T>
TRILHA_HD inline T turns(T y, T x) {
  const T ax = std::fabs(x), ay = std::fabs(y);
  const T larger = max(ax, ay), smaller = min(ax, ay);
  if (!(larger > 0)) return 0;
  const T r = smaller / larger, q = r * r;
  T sum = T(0.001084130003);
  sum = fma(sum, q, T(-0.00534827604));
  sum = fma(sum, q, T(0.012672498939));
  sum = fma(sum, q, T(-0.021061516886));
  sum = fma(sum, q, T(0.031525117263));
  sum = fma(sum, q, T(-0.053026238129));
  sum = fma(sum, q, T(0.159154324225));
  T angle = sum * r;
  if (ay > ax) angle = T(0.25) - angle;
  if (x < 0) angle = T(0.5) - angle;
  return y < 0 ? -angle : angle;
}

/// Longitude and latitude on a sphere where the normal, of length one, is that: u grows to the right seen
/// from outside and is ½ at +z, v grows from 0 at −y to 1 at +y. Both in [0, 1], to 2e-7. The seam lies at
/// −z; at the poles u is ½.
template <class T>
TRILHA_HD inline Vec2<T> sphere_uv(const Vec3<T>& normal) {
  const T from_axis = std::sqrt(fma(normal.x, normal.x, normal.z * normal.z));
  return {T(0.5) + turns(normal.x, normal.z), T(0.5) + 2 * turns(normal.y, from_axis)};
}

/// uv_density of a sphere. It grows towards the poles, and is held there at what it is where sin θ = 2⁻⁷. 0
/// for a radius of 0.
template <class T>
TRILHA_HD inline T sphere_uv_density(T radius, const Vec3<T>& normal) {
  const T from_axis = std::sqrt(fma(normal.x, normal.x, normal.z * normal.z));
  const T density = 1 / (T(pi) * radius * std::sqrt(2 * max(from_axis, T(0x1p-7))));
  return is_normal(density) ? density : T(0);
}

/// Two vectors that are a right-handed orthonormal basis with a normal of length one (Duff, Burgess,
/// Christensen, Hery, Kensler, Liani & Villemin 2017). Of (0, 1, 0) they are +x and −z.
template <class T>
TRILHA_HD inline void basis_of(const Vec3<T>& normal, Vec3<T>& first, Vec3<T>& second) {
  const T sign = normal.z < 0 ? T(-1) : T(1);
  const T a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
  first = {fma(sign * normal.x, normal.x * a, T(1)), sign * b, -sign * normal.x};
  second = {b, fma(normal.y, normal.y * a, sign), -normal.y};
}

/// Texture coordinates of a point on a plane with that normal, of length one: its coordinates along the basis
/// of the normal, a texture a unit of length, from the point nearest to the origin. Their density is 1.
template <class T>
TRILHA_HD inline Vec2<T> plane_uv(const Vec3<T>& normal, const Vec3<T>& point) {
  Vec3<T> first, second;
  basis_of(normal, first, second);
  return {fused_dot(first, point), fused_dot(second, point)};
}

// ---- what is uploaded ----------------------------------------------------------

/// Which maps of materials are looked at.
struct WantedMaps {
  bool diffuse = false, specular = false, emission = false, normal = false;
  bool bump = false, opacity = false, roughness = false, metallic = false;
};

/// Which textures of the scene those maps name: one answer a texture.
std::vector<bool> wanted_textures(const Scene& scene, const WantedMaps& maps);

/// The wanted textures of a scene on a backend; the scene may go.
class SceneTextures {
 public:
  SceneTextures() = default;
  /// `wanted` has one answer a texture. Without `mip_levels` only the largest level of each is there, which
  /// is all that nearest and bilinear look at. Throws std::bad_alloc where the backend has no room,
  /// std::logic_error where a level does not have width × height texels, or has a side beyond
  /// most_texture_side.
  SceneTextures(const Scene& scene, const Stream& stream, const std::vector<bool>& wanted, bool mip_levels);

  TexturesView view() const;
  /// What its buffers hold.
  std::size_t bytes() const;

 private:
  Buffer<u8vec4> bytes_;
  Buffer<vec4> floats_;
  Buffer<TextureLevelView> levels_;
  Buffer<TextureView> textures_;
  Buffer<float> of_byte_;
};

}  // namespace trilha
