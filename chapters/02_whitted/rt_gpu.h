#pragma once
// The three programs that Ordeix & Cioli (2010, section 4.3) wrote and measured, by brute force (their grid
// of 1×1×1; chapter 03 has the others):
//
// - RT-GPU: the scene as a list of objects, each its corners with their normals, in global memory.
// - RT-GPU-JM ("memory hierarchy"): triangles, normals, lights and materials each a list of vectors of four
//   floats, read through textures; what there is once (counts, ambient light) in constant memory.
// - RT-GPU-JM-IR ("ray intersection"): and a test of fewer operations. They do not say which; here it is
//   Möller–Trumbore's.
//
// The tree is this chapter's own: their restrictions (one light, no surface that mirrors and transmits, no
// colour in the shadow of glass) are gone. What they did not have is not read: maps, alpha, spheres, planes.
// On the CPU the same arrangements lie in its one memory: those are the twins RT-CPU, RT-CPU-JM and
// RT-CPU-JM-IR.

#include <optional>

#include "chapters/02_whitted/whitted.h"
#include "chapters/02_whitted/whitted_scene.h"
#include "common/parallel/kernel_cost.h"

namespace trilha {

// ---- RT-GPU: a list of objects in global memory ------------------------------

struct RtTriangle {
  vec3 a, normal_a, b, normal_b, c, normal_c;
  std::uint32_t material;
};

/// What there is once.
struct RtHeader {
  std::uint32_t triangles, lamps;
  vec3 ambient, background;
  bool smooth;
};

/// All of it behind one pointer: every number is fetched from global memory.
struct RtList {
  RtHeader header;
  const RtTriangle* triangles;
  const WhittedMaterial* materials;
  const Medium* media;
  const Lamp* lamps;
};

struct OnlyTriangles {
  TRILHA_HD bool is_sphere(std::uint32_t) const { return false; }
  TRILHA_HD Sphere sphere(std::uint32_t) const { return {}; }
  TRILHA_HD Plane plane(std::uint32_t) const { return {}; }
};

struct RtGlobalView : OnlyTriangles {
  const RtList* list;

  TRILHA_HD std::uint32_t triangle_count() const { return list->header.triangles; }
  TRILHA_HD std::uint32_t lamps_in_all() const { return list->header.lamps; }
  TRILHA_HD vec3 ambient_light() const { return list->header.ambient; }
  TRILHA_HD vec3 background_light() const { return list->header.background; }
  TRILHA_HD bool has_normals() const { return list->header.smooth; }
  TRILHA_HD Corners<vec3> corners(std::uint32_t i) const {
    const RtTriangle& t = list->triangles[i];
    return {t.a, t.b, t.c};
  }
  TRILHA_HD Corners<vec3> corner_normals(std::uint32_t i) const {
    const RtTriangle& t = list->triangles[i];
    return {t.normal_a, t.normal_b, t.normal_c};
  }
  TRILHA_HD std::uint32_t material_of(std::uint32_t i) const { return list->triangles[i].material; }
  TRILHA_HD WhittedMaterial material(std::uint32_t m) const { return list->materials[m]; }
  TRILHA_HD Medium medium(std::uint32_t m) const { return list->media[m]; }
  TRILHA_HD Lamp lamp(std::uint32_t l) const { return list->lamps[l]; }
};

// ---- RT-GPU-JM: vectors of four, through textures ----------------------------

/// An array of vectors of four floats: on the device read through a texture, on the CPU as it lies there.
struct Texels {
  const vec4* data;
  std::uint64_t texture;

  TRILHA_HD vec4 operator[](std::size_t i) const {
#if defined(__CUDA_ARCH__)
    const float4 texel = tex1Dfetch<float4>(texture, static_cast<int>(i));
    return {texel.x, texel.y, texel.z, texel.w};
#else
    return data[i];
#endif
  }
};

/// A whole number as the float that has its bits, and back.
TRILHA_HD inline float as_float(std::uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}
TRILHA_HD inline std::uint32_t as_bits(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// The fourth component of a triangle's first corner is its material. A launch's arguments, and so the
/// header, lie in constant memory.
struct RtTextureView : OnlyTriangles {
  static constexpr std::size_t texels_a_lamp = 4, texels_a_material = 5;
  RtHeader header;
  Texels triangles, normals, lamps, materials, media;

  TRILHA_HD std::uint32_t triangle_count() const { return header.triangles; }
  TRILHA_HD std::uint32_t lamps_in_all() const { return header.lamps; }
  TRILHA_HD vec3 ambient_light() const { return header.ambient; }
  TRILHA_HD vec3 background_light() const { return header.background; }
  TRILHA_HD bool has_normals() const { return header.smooth; }
  TRILHA_HD Corners<vec3> corners(std::uint32_t i) const { return three(triangles, i); }
  TRILHA_HD Corners<vec3> corner_normals(std::uint32_t i) const { return three(normals, i); }
  TRILHA_HD std::uint32_t material_of(std::uint32_t i) const {
    return as_bits(triangles[3 * std::size_t{i}].w);
  }
  TRILHA_HD WhittedMaterial material(std::uint32_t m) const {
    const std::size_t at = texels_a_material * m;
    const vec4 diffuse = materials[at], specular = materials[at + 1], emission = materials[at + 2];
    WhittedMaterial result{};
    result.diffuse = vec3(diffuse);
    result.shininess = diffuse.w;
    result.specular = vec3(specular);
    result.emission = vec3(emission);
    result.medium = as_bits(emission.w);
    result.reflection = vec3(materials[at + 3]);
    result.transmission = vec3(materials[at + 4]);
    result.opacity = 1;
    return result;
  }
  TRILHA_HD Medium medium(std::uint32_t m) const {
    const vec4 texel = media[m];
    return {vec3(texel), texel.w};
  }
  TRILHA_HD Lamp lamp(std::uint32_t l) const {
    const std::size_t at = texels_a_lamp * l;
    const vec4 position = lamps[at], direction = lamps[at + 1], intensity = lamps[at + 2],
               fall = lamps[at + 3];
    return {static_cast<Light::Kind>(as_bits(position.w)),
            vec3(position),
            vec3(direction),
            vec3(intensity),
            vec3(fall),
            direction.w,
            intensity.w,
            fall.w};
  }

 private:
  TRILHA_HD static Corners<vec3> three(const Texels& texels, std::uint32_t i) {
    const std::size_t at = 3 * std::size_t{i};
    return {vec3(texels[at]), vec3(texels[at + 1]), vec3(texels[at + 2])};
  }
};

// ---- their triangles ---------------------------------------------------------

/// The view's triangles as primitives of chapter 01's brute force, by a test that keeps the corners as they
/// are.
template <class View, class Test>
struct RtTriangles {
  using Scalar = float;
  View view;
  std::uint32_t count;
  bool surely_ahead;

  TRILHA_HD auto constants(const Ray& ray) const { return Test::constants(ray); }
  template <class Constants>
  TRILHA_HD void intersect(std::uint32_t i, const Ray& ray, const Constants& constants, Hit& hit) const {
    const Corners<vec3> corners = view.corners(i);
    float numbers[Test::numbers];
    Test::prepare(corners.a, corners.b, corners.c, numbers);
    const Numbers<float> triangle{numbers};
    const auto measure = Test::measure(triangle, ray, constants);
    if (Test::may_hit(measure))
      Triangles<Test>{nullptr, 0, false, surely_ahead}.settle(measure, triangle, i, ray, constants, hit);
  }
};

/// One of the three programs, on the device or as its twin on the CPU.
class RtGpu {
 public:
  static constexpr unsigned most_threads = 256;  ///< in a block

  /// On the device a block has block_width · block_height threads, for as many neighbouring pixels; a CPU has
  /// no blocks. Throws InputError for more than most_threads, or where a list is longer than a texture may
  /// be.
  RtGpu(const WhittedScene& scene, Kernel version, int block_width, int block_height, const Stream& stream);
  ~RtGpu();
  RtGpu(const RtGpu&) = delete;
  RtGpu& operator=(const RtGpu&) = delete;

  /// As SplitTrees::colours says.
  void colours(const Terms& terms, const Ray* rays, vec4* colours, std::size_t n) const;

  /// What its kernel takes of a CUDA device; nothing on the CPU.
  std::optional<KernelCost> cost() const;

  /// The scene as RT-GPU has it, or as the two others: for structures of later chapters.
  RtGlobalView global_view() const { return {{}, list_.data()}; }
  const RtTextureView& texture_view() const { return texture_view_; }

 private:
  Texels texels(Buffer<vec4>& buffer, const std::vector<vec4>& values);

  Stream stream_;
  Kernel version_;
  unsigned threads_;
  std::uint32_t count_;
  RtTextureView texture_view_{};
  Buffer<RtTriangle> triangles_;
  Buffer<WhittedMaterial> materials_;
  Buffer<Medium> media_;
  Buffer<Lamp> lamps_;
  Buffer<RtList> list_;
  Buffer<vec4> texels_[5];
  std::vector<std::uint64_t> textures_;
};

}  // namespace trilha
