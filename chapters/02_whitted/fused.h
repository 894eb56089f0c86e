#pragma once
// Whitted's tree as one kernel: a thread follows a whole tree, with the stack in its own memory.

#include <optional>

#include "chapters/02_whitted/whitted.h"
#include "common/parallel/backend.h"
#include "common/parallel/kernel_cost.h"

namespace trilha {

/// Ray i → colours[i], as SplitTrees::colours says.
template <unsigned features, class View, class Structure>
struct FollowTree {
  View view;
  Structure structure;
  Terms terms;
  const Ray* rays;
  vec4* colours;

  TRILHA_HD void operator()(std::size_t i) const {
    colours[i] = vec4(0);
    if (!(rays[i].t_max > rays[i].t_min)) return;
    bool overflow = false;
    const vec4 light = whitted<features>(view, structure, terms, rays[i], overflow);
    colours[i] = vec4(vec3(light), overflow ? -light.w : light.w);
  }
};

/// Trees for brute force, by the smallest kernel that has these features. Batches are small: a tree can be
/// thousands of tests.
void fused_colours(const Stream& stream, const ShadingView& view,
                   const WithBodies<BruteForce<Triangles<Watertight>>>& structure, const Terms& terms,
                   unsigned features, const Ray* rays, vec4* colours, std::size_t n);

/// What that kernel takes of a CUDA device; nothing on the CPU.
std::optional<KernelCost> fused_cost(const Stream& stream, unsigned features);

}  // namespace trilha
