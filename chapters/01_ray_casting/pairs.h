#pragma once
// Pairs of a triangle and a ray that often meet, ordinary and hostile: what the tests are measured and tested
// with. The same bits on every machine: only sums, products and square roots make them.

#include <vector>

#include "chapters/01_ray_casting/ray_triangle.h"
#include "common/math/random.h"
#include "common/parallel/backend.h"

namespace trilha {

enum class PairKind {
  random,
  sliver,
  at_edge,
  at_vertex,
  on_surface,
  grazing,
  along_axis,
  no_area,
  tiny,
  huge,
  far,
  odd
};
constexpr int pair_kinds = 12;

/// Names for people, by kind.
struct PairKindText {
  const char *name, *what;
};
constexpr PairKindText pair_kind_texts[pair_kinds] = {
    {"random", "vertices uniform in a cube, rays from three times as far"},
    {"slivers", "10⁷ times as long as wide"},
    {"at edges", "rays aimed at points of an edge"},
    {"at vertices", "rays aimed at a vertex"},
    {"on the surface", "rays that start on the triangle"},
    {"grazing", "rays along an edge, at a slope of 10⁻⁴ at most to the triangle's plane"},
    {"along axes", "rays parallel to a coordinate axis"},
    {"no area", "two vertices are the same point"},
    {"size 1e-18", "the random pairs, scaled by 2⁻⁶⁰"},
    {"size 1e18", "the random pairs, scaled by 2⁶⁰"},
    {"1e5 sizes away", "the random pairs, moved by 10⁵"},
    {"NaN, inf, -0", "one component is NaN, infinite, −0, subnormal or 3·10³⁸"}};

struct Pair {
  vec3 a, b, c;
  Ray ray;
};

/// The next pair of that kind. Half of them are aimed at a point of the triangle, half at one of its plane
/// that may lie beside it. No expression draws two random numbers, whose order would be the compiler's.
TRILHA_HD inline Pair make_pair(Random& random, PairKind kind) {
  const auto cube = [&] {
    const float x = random.uniform(-1, 1), y = random.uniform(-1, 1);
    return vec3(x, y, random.uniform(-1, 1));
  };
  Pair p{cube(), cube(), cube(), {}};
  float u = random.uniform(), v = random.uniform();
  if (random.uniform() < 0.5f) {
    if (u + v > 1) u = 1 - u, v = 1 - v;
  } else {
    u = 1.5f * u - 0.25f, v = 1.5f * v - 0.25f;
  }
  if (kind == PairKind::sliver) {
    const vec3 on_edge = p.a + (p.b - p.a) * random.uniform();
    p.c = on_edge + cube() * 1e-7f;
  }
  if (kind == PairKind::at_edge) u = 0;
  if (kind == PairKind::at_vertex) u = v = 0;
  const vec3 aim = p.a * (1 - u - v) + p.b * u + p.c * v;
  p.ray.origin = cube() * 3.0f;
  if (kind == PairKind::on_surface) p.ray.origin = aim;
  p.ray.direction = aim - p.ray.origin;
  if (kind == PairKind::on_surface) p.ray.direction = cube();
  if (kind == PairKind::grazing) {
    p.ray.direction = p.b - p.a + cube() * 1e-4f;
    p.ray.origin = aim - p.ray.direction * 2.0f;
  }
  if (kind == PairKind::along_axis) {
    const auto axis = static_cast<int>(random.index(3));
    p.ray.direction = vec3(0);
    p.ray.direction[axis] = random.uniform() < 0.5f ? -1.0f : 1.0f;
    p.ray.origin = aim - p.ray.direction * 2.0f;
  }
  if (kind == PairKind::no_area) p.b = p.a;
  float scale = 1;
  if (kind == PairKind::tiny) scale = 0x1p-60f;
  if (kind == PairKind::huge) scale = 0x1p60f;
  p.a *= scale, p.b *= scale, p.c *= scale, p.ray.origin *= scale;
  if (kind == PairKind::far) {
    const vec3 away = {66319.0f, 551.0f, -74843.0f};
    p.a += away, p.b += away, p.c += away, p.ray.origin += away;
  }
  if (kind == PairKind::odd) {
    const float values[5] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                             -0.0f, 1e-42f, 3e38f};
    const float value = values[random.index(5)];
    vec3* vectors[5] = {&p.a, &p.b, &p.c, &p.ray.origin, &p.ray.direction};
    vec3& victim = *vectors[random.index(5)];
    victim[static_cast<int>(random.index(3))] = value;
  }
  return p;
}

/// n pairs of a kind; pair i depends on seed and i alone.
std::vector<Pair> make_pairs(PairKind kind, std::size_t n, std::uint64_t seed);

/// What a test answers to a pair; all zero for a miss.
template <class T>
struct Answer {
  std::uint32_t hit, front;
  T t, u, v;
};

/// The answers of Test in the scalar T, computed on the stream's backend.
template <class Test, class T>
std::vector<Answer<T>> answers(const Stream& stream, const std::vector<Pair>& pairs);

}  // namespace trilha
