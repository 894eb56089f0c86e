#include "chapters/02_whitted/fused.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

using Structure = WithBodies<BruteForce<Triangles<Watertight>>>;

}  // namespace

void fused_colours(const Stream& stream, const ShadingView& view, const Structure& structure,
                   const Terms& terms, unsigned features, const Ray* rays, vec4* colours, std::size_t n) {
  with_features(features, [&](auto chosen) {
    for_each(stream, n, FollowTree<chosen(), ShadingView, Structure>{view, structure, terms, rays, colours},
             8);
  });
}

std::optional<KernelCost> fused_cost(const Stream& stream, unsigned features) {
  return with_features(features, [&](auto chosen) {
    return kernel_cost<FollowTree<chosen(), ShadingView, Structure>>(stream);
  });
}

}  // namespace trilha
