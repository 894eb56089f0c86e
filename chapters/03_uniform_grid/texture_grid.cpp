#include "chapters/03_uniform_grid/texture_grid.h"

#include "chapters/02_whitted/fused.h"
#include "common/error.h"
#include "common/parallel/cancellation.h"
#include "common/parallel/for_each.h"

#if defined(__CUDACC__)
#include "cuda/launch.h"
#include "cuda/texture.h"
#endif

namespace trilha {
namespace {

/// As in chapter 02: code for all that the three programs know.
constexpr unsigned rt_features = feature::mirrors | feature::glass | feature::lamps;

template <class View, class Structure>
using RtTree = FollowTree<rt_features, View, Structure>;

/// Number i → component i % 4 of texel i / 4.
struct PackFour {
  const std::uint32_t* numbers;
  std::size_t count;
  vec4* texels;

  TRILHA_HD void operator()(std::size_t i) const {
    const auto number = [&](std::size_t k) { return as_float(k < count ? numbers[k] : 0); };
    texels[i] = vec4(number(4 * i), number(4 * i + 1), number(4 * i + 2), number(4 * i + 3));
  }
};

}  // namespace

RtGrid::RtGrid(const WhittedScene& scene, Kernel version, int block_width, int block_height,
               const GridSettings& settings, const Stream& stream)
    : stream_(stream),
      scene_(scene, version, block_width, block_height, stream),
      version_(version),
      threads_(static_cast<unsigned>(block_width * block_height)),
      count_(scene.triangle_count()) {
  const Buffer<vec3> positions(stream_, scene.mesh().positions);
  const Buffer<uvec3> triangles(stream_, scene.mesh().triangles);
  Grid grid = build_grid(stream_, {positions.data(), triangles.data(), count_}, settings);
  view_ = grid.view;
  statistics_ = grid.statistics;
  if (version_ == Kernel::rt_gpu) {
    starts_ = std::move(grid.starts);
    primitives_ = std::move(grid.primitives);
    return;
  }
  texture_view_.view = view_;
  texture_view_.starts = texels(grid.starts, texels_[0]);
  texture_view_.primitives = texels(grid.primitives, texels_[1]);
}

RtGrid::~RtGrid() {
#if defined(__CUDACC__)
  for (const std::uint64_t texture : textures_) cuda::destroy_texture(texture);
#endif
}

TexelNumbers RtGrid::texels(const Buffer<std::uint32_t>& numbers, Buffer<vec4>& texels) {
  const std::size_t n = (numbers.size() + 3) / 4;
  constexpr std::size_t longest = std::size_t{1} << 27;
  if (n > longest)
    throw InputError("a texture holds " + std::to_string(longest) + " vectors, and the grid needs " +
                     std::to_string(n) + "; choose fewer cells, or another kernel");
  texels = Buffer<vec4>(stream_.backend(), n);
  for_each(stream_, n, PackFour{numbers.data(), numbers.size(), texels.data()});
  TexelNumbers result{{texels.data(), 0}};
#if defined(__CUDACC__)
  if (stream_.backend() == Backend::cuda && n > 0) {
    result.texels.texture = cuda::create_texture(texels.data(), n);
    textures_.push_back(result.texels.texture);
  }
#endif
  return result;
}

template <class Function>
auto RtGrid::with_pass(const Terms& terms, const Ray* rays, vec4* colours, const Function& function) const {
  const bool ahead = surely_ahead(terms);
  const auto through_textures = [&](auto test) {
    using Primitives = RtTriangles<RtTextureView, decltype(test)>;
    const RtTextureView& view = scene_.texture_view();
    return function(RtTree<RtTextureView, TextureGrid<Primitives>>{
        view, {texture_view_, {view, count_, ahead}}, terms, rays, colours});
  };
  switch (version_) {
    case Kernel::rt_gpu_jm:
      return through_textures(PlaneBarycentric{});
    case Kernel::rt_gpu_jm_ir:
      return through_textures(MollerTrumbore{});
    default: {
      using Primitives = RtTriangles<RtGlobalView, PlaneBarycentric>;
      const RtGlobalView view = scene_.global_view();
      return function(RtTree<RtGlobalView, UniformGrid<Primitives>>{
          view, {view_, {view, count_, ahead}}, terms, rays, colours});
    }
  }
}

void RtGrid::colours(const Terms& terms, const Ray* rays, vec4* colours, std::size_t n) const {
  with_pass(terms, rays, colours, [&](const auto& pass) {
#if defined(__CUDACC__)
    if (stream_.backend() == Backend::cuda) {
      stop_if_cancelled();
      return cuda::launch(stream_.native(), 0, n, pass, std::source_location::current(), threads_);
    }
#endif
    for_each(stream_, n, pass, 8);
  });
}

std::optional<KernelCost> RtGrid::cost() const {
  return with_pass({}, nullptr, nullptr,
                   [&](const auto& pass) { return kernel_cost<std::decay_t<decltype(pass)>>(stream_); });
}

}  // namespace trilha
