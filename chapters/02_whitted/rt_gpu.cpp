#include "chapters/02_whitted/rt_gpu.h"

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

/// Those kernels have code for all that the three programs know: no maps, no alpha.
constexpr unsigned rt_features = feature::mirrors | feature::glass | feature::lamps;

template <class View, class Test>
using RtTree = FollowTree<rt_features, View, BruteForce<RtTriangles<View, Test>>>;

template <class View, class Test>
void follow(const Stream& stream, const View& view, std::uint32_t count, const Terms& terms, unsigned threads,
            const Ray* rays, vec4* colours, std::size_t n) {
  const RtTree<View, Test> pass{view, {{view, count, surely_ahead(terms)}}, terms, rays, colours};
#if defined(__CUDACC__)
  if (stream.backend() == Backend::cuda) {
    stop_if_cancelled();
    return cuda::launch(stream.native(), 0, n, pass, std::source_location::current(), threads);
  }
#endif
  (void)threads;  // a CPU has none to a block
  for_each(stream, n, pass, 8);
}

template <class View, class Test>
std::optional<KernelCost> cost_of(const Stream& stream) {
  return kernel_cost<RtTree<View, Test>>(stream);
}

}  // namespace

RtGpu::RtGpu(const WhittedScene& scene, Kernel version, int block_width, int block_height,
             const Stream& stream)
    : stream_(stream),
      version_(version),
      threads_(static_cast<unsigned>(block_width * block_height)),
      count_(scene.triangle_count()) {
  if (threads_ > most_threads)
    throw InputError("a block of " + std::to_string(block_width) + " times " + std::to_string(block_height) +
                     " threads is too large; there may be " + std::to_string(most_threads));
  const ShadingView& view = scene.view();
  const RtHeader header{count_, view.lamp_count, view.ambient, view.background, view.has_normals()};

  std::vector<RtTriangle> list(count_);
  const Mesh& mesh = scene.mesh();
  for (std::uint32_t i = 0; i < count_; ++i) {
    const uvec3 t = mesh.triangles[i];
    const auto normal = [&](std::uint32_t vertex) { return header.smooth ? mesh.normals[vertex] : vec3(0); };
    list[i] = {mesh.positions[t.x],
               normal(t.x),
               mesh.positions[t.y],
               normal(t.y),
               mesh.positions[t.z],
               normal(t.z),
               mesh.materials.empty() ? 0 : mesh.materials[i]};
  }
  if (version == Kernel::rt_gpu) {
    triangles_ = Buffer(stream_, list);
    materials_ = Buffer(stream_, scene.materials());
    media_ = Buffer(stream_, scene.media());
    lamps_ = Buffer(stream_, scene.lamps());
    list_ = Buffer(stream_, std::vector<RtList>{{header, triangles_.data(), materials_.data(), media_.data(),
                                                 lamps_.data()}});
    return;
  }
  std::vector<vec4> triangles, normals, lamps, materials, media;
  for (const RtTriangle& t : list) {
    triangles.insert(triangles.end(), {vec4(t.a, as_float(t.material)), vec4(t.b, 0), vec4(t.c, 0)});
    if (header.smooth)
      normals.insert(normals.end(), {vec4(t.normal_a, 0), vec4(t.normal_b, 0), vec4(t.normal_c, 0)});
  }
  for (const Lamp& l : scene.lamps())
    lamps.insert(lamps.end(),
                 {vec4(l.position, as_float(static_cast<std::uint32_t>(l.kind))), vec4(l.direction, l.range),
                  vec4(l.intensity, l.inner), vec4(l.attenuation, l.outer)});
  for (const WhittedMaterial& m : scene.materials())
    materials.insert(materials.end(),
                     {vec4(m.diffuse, m.shininess), vec4(m.specular, 0), vec4(m.emission, as_float(m.medium)),
                      vec4(m.reflection, 0), vec4(m.transmission, 0)});
  for (const Medium& m : scene.media()) media.emplace_back(m.absorption, m.refraction_index);
  texture_view_.header = header;
  texture_view_.triangles = texels(texels_[0], triangles);
  texture_view_.normals = texels(texels_[1], normals);
  texture_view_.lamps = texels(texels_[2], lamps);
  texture_view_.materials = texels(texels_[3], materials);
  texture_view_.media = texels(texels_[4], media);
}

RtGpu::~RtGpu() {
#if defined(__CUDACC__)
  for (const std::uint64_t texture : textures_) cuda::destroy_texture(texture);
#endif
}

Texels RtGpu::texels(Buffer<vec4>& buffer, const std::vector<vec4>& values) {
  buffer = Buffer(stream_, values);
  Texels result{buffer.data(), 0};
  if (stream_.backend() == Backend::cpu || values.empty()) return result;
  constexpr std::size_t longest = std::size_t{1} << 27;
  if (values.size() > longest)
    throw InputError("a texture holds " + std::to_string(longest) + " vectors, and the scene needs " +
                     std::to_string(values.size()) + " in a list; choose --kernel rt-gpu, fused or split");
#if defined(__CUDACC__)
  result.texture = cuda::create_texture(buffer.data(), values.size());
  textures_.push_back(result.texture);
#endif
  return result;
}

void RtGpu::colours(const Terms& terms, const Ray* rays, vec4* colours, std::size_t n) const {
  switch (version_) {
    case Kernel::rt_gpu_jm:
      return follow<RtTextureView, PlaneBarycentric>(stream_, texture_view_, count_, terms, threads_, rays,
                                                     colours, n);
    case Kernel::rt_gpu_jm_ir:
      return follow<RtTextureView, MollerTrumbore>(stream_, texture_view_, count_, terms, threads_, rays,
                                                   colours, n);
    default:
      return follow<RtGlobalView, PlaneBarycentric>(stream_, {{}, list_.data()}, count_, terms, threads_,
                                                    rays, colours, n);
  }
}

std::optional<KernelCost> RtGpu::cost() const {
  switch (version_) {
    case Kernel::rt_gpu_jm:
      return cost_of<RtTextureView, PlaneBarycentric>(stream_);
    case Kernel::rt_gpu_jm_ir:
      return cost_of<RtTextureView, MollerTrumbore>(stream_);
    default:
      return cost_of<RtGlobalView, PlaneBarycentric>(stream_);
  }
}

}  // namespace trilha
