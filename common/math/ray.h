#pragma once

#include <limits>

#include "common/math/vector.h"

namespace trilha {

/// The points origin + t·direction with t in [t_min, t_max). The direction need not have length one; t is in
/// its units.
template <class T>
struct alignas(4 * sizeof(T)) RayOf {
  Vec3<T> origin{0};
  T t_min = 0;
  Vec3<T> direction{0, 0, 1};
  T t_max = std::numeric_limits<T>::infinity();

  /// The same ray in another scalar.
  template <class W>
  TRILHA_HD RayOf<W> as() const {
    return {Vec3<W>(origin), static_cast<W>(t_min), Vec3<W>(direction), static_cast<W>(t_max)};
  }
};
using Ray = RayOf<float>;

constexpr std::uint32_t no_primitive = 0xffffffffu;

/// Where a ray meets a primitive: at t, with barycentric coordinates u (of the second vertex) and v (of the
/// third). A miss has primitive == no_primitive and t == t_max of the ray.
template <class T>
struct HitOf {
  T t = std::numeric_limits<T>::infinity();
  std::uint32_t primitive = no_primitive;
  std::uint32_t instance = 0;
  T u = 0;
  T v = 0;

  TRILHA_HD bool found() const { return primitive != no_primitive; }
};
using Hit = HitOf<float>;

/// Does a hit of primitive `i` at t come before the hit so far? Of equal t the lower number does, in whatever
/// order primitives are asked; a t of t_max is none.
template <class T>
TRILHA_HD bool comes_before(T t, std::uint32_t i, const HitOf<T>& hit) {
  return t < hit.t || (t == hit.t && i < hit.primitive && hit.found());
}

/// Counts what a traversal did; the heat maps and reports read it.
struct Probe {
  std::uint32_t nodes_visited = 0;
  std::uint32_t primitives_tested = 0;

  TRILHA_HD void visit_node() { ++nodes_visited; }
  TRILHA_HD void test_primitives(std::uint32_t n) { primitives_tested += n; }
};

/// A probe that compiles to nothing.
struct NoProbe {
  TRILHA_HD void visit_node() {}
  TRILHA_HD void test_primitives(std::uint32_t) {}
};

}  // namespace trilha
