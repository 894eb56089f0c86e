#pragma once
// What casters and tracers ask of triangles, in whatever structure they lie: two questions, each for many
// rays at once. This chapter's loops answer them; later chapters put a structure in their place.

#include <functional>
#include <memory>

#include "chapters/01_ray_casting/ray_triangle.h"
#include "common/parallel/backend.h"

namespace trilha {

/// Triangles on a backend.
struct TriangleArrays {
  const vec3* positions;
  const uvec3* triangles;
  std::uint32_t count;
};

/// What counts as a hit; see Triangles.
struct HitRules {
  bool one_sided = false, surely_ahead = false;
};

class TriangleStructure {
 public:
  virtual ~TriangleStructure() = default;

  void set_rules(const HitRules& rules) { rules_ = rules; }

  /// The nearest hit of each of n rays, t in [ray.t_min, ray.t_max); of equal t the lowest number. The arrays
  /// of this and the others lie on the structure's backend. Throws Cancelled in work that was cancelled.
  virtual void closest(const Ray* rays, Hit* hits, std::size_t n) const = 0;
  /// 1 for each ray that has any such hit, else 0.
  virtual void occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const = 0;
  /// What the nearest hit of each ray takes: nodes or cells visited, triangles tested.
  virtual void probe(const Ray* rays, Probe* probes, std::size_t n) const = 0;

 protected:
  HitRules rules_;
};

/// Makes a structure of triangles, whose arrays need not stay.
using MakeStructure =
    std::function<std::unique_ptr<TriangleStructure>(const Stream& stream, const TriangleArrays& triangles)>;

/// The order in which rays meet triangles where there is no structure.
enum class Loop { plain, blocked };

/// No structure: every triangle is asked, by this chapter's loops.
MakeStructure brute_force(TriangleTest test, Loop loop = Loop::blocked);

}  // namespace trilha
