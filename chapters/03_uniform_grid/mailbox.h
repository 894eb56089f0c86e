#pragma once
// Mailboxes (Amanatides & Woo 1987; small and hashed: Wald 2004, §7.3.3): a triangle in many cells is tested
// once a ray. Each ray remembers which triangles it asked last, in a small table on the stack that needs no
// clearing between rays and no memory that threads share. A triangle that was asked and did not become the
// hit cannot become it later, since the hit only comes nearer.

#include "chapters/03_uniform_grid/uniform_grid.h"

namespace trilha {

/// The triangles asked last, each in the slot of its number's last bits: a later one of the same slot takes
/// it over, and the earlier one would be tested again.
struct Mailbox {
  static constexpr std::uint32_t slots = 16;
  std::uint32_t asked[slots];

  TRILHA_HD Mailbox() {
    for (std::uint32_t& triangle : asked) triangle = no_primitive;
  }
  /// Was it asked of late? From now on it was.
  TRILHA_HD bool was_asked(std::uint32_t triangle) {
    std::uint32_t& slot = asked[triangle % slots];
    if (slot == triangle) return true;
    slot = triangle;
    return false;
  }
};

/// As AskCell does, but not the same primitive again.
template <Query query, class Primitives, class ProbeType>
struct AskCellOnce {
  using T = typename Primitives::Scalar;
  const GridView& grid;
  const Primitives& primitives;
  const RayOf<T>& ray;
  ProbeType& probe;
  decltype(primitives.constants(ray)) constants = primitives.constants(ray);
  HitOf<T> hit{ray.t_max};
  Mailbox mailbox{};

  template <class Leave>
  TRILHA_HD bool operator()(std::uint32_t cell, Leave t_leave) {
    const std::uint32_t end = grid.starts[cell + 1];
    probe.visit_node();
    for (std::uint32_t k = grid.starts[cell]; k < end; ++k) {
      const std::uint32_t i = grid.primitives[k];
      if (mailbox.was_asked(i)) continue;
      probe.test_primitives(1);
      primitives.intersect(i, ray, constants, hit);
      if (query == Query::occluded && hit.found()) return true;
    }
    return hit.t < t_leave;
  }
};

/// The same hits as UniformGrid, of which this is a variant: fewer tests, more bookkeeping.
template <class Primitives>
struct MailboxGrid {
  using Scalar = typename Primitives::Scalar;
  GridView grid;
  Primitives primitives;

  template <class ProbeType>
  TRILHA_HD HitOf<Scalar> closest(const RayOf<Scalar>& ray, ProbeType& probe) const {
    if (asks_all(grid, ray)) return BruteForce<Primitives>{primitives}.closest(ray, probe);
    AskCellOnce<Query::closest, Primitives, ProbeType> ask{grid, primitives, ray, probe};
    walk(grid, ray, ask);
    return ask.hit;
  }
  template <class ProbeType>
  TRILHA_HD bool occluded(const RayOf<Scalar>& ray, ProbeType& probe) const {
    if (asks_all(grid, ray)) return BruteForce<Primitives>{primitives}.occluded(ray, probe);
    AskCellOnce<Query::occluded, Primitives, ProbeType> ask{grid, primitives, ray, probe};
    walk(grid, ray, ask);
    return ask.hit.found();
  }
};

}  // namespace trilha
