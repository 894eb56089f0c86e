#pragma once
// The scene on one backend: all that the chosen kernels read, and nothing else.

#include "chapters/02_whitted/settings.h"

namespace trilha {

struct PrimitiveCounts {
  std::uint32_t triangles = 0, spheres = 0, planes = 0;
};

class WhittedScene {
 public:
  /// Throws InputError for more primitives or glass materials than there are numbers (2³² − 2, 65 535), and
  /// what flattened() throws.
  WhittedScene(const Scene& scene, const WhittedSettings& settings, const Stream& stream);

  const ShadingView& view() const { return view_; }
  /// Those that scene and settings need: what the kernel must have code for.
  unsigned features() const { return features_; }
  std::uint32_t triangle_count() const { return view_.triangle_count(); }
  const vec3* positions() const { return positions_.data(); }
  const uvec3* triangles() const { return triangles_.data(); }
  const Box& bounds() const { return bounds_; }
  /// False where no glass body can be: most eyes are there, and need not ask.
  bool may_be_in_glass(const vec3& point) const;
  /// Primitives that no light goes through come first; so many of each kind do.
  const PrimitiveCounts& opaque() const { return opaque_; }

  // What lies on the host, for the versions that arrange it otherwise.
  const Mesh& mesh() const { return mesh_; }  ///< kept only for the versions of Ordeix & Cioli
  const std::vector<WhittedMaterial>& materials() const { return host_materials_; }
  const std::vector<Medium>& media() const { return host_media_; }
  const std::vector<Lamp>& lamps() const { return host_lamps_; }

 private:
  ShadingView view_;
  unsigned features_;
  Box bounds_, glass_bounds_;
  bool glass_planes_ = false;
  PrimitiveCounts opaque_;
  Mesh mesh_;
  std::vector<WhittedMaterial> host_materials_;
  std::vector<Medium> host_media_;
  std::vector<Lamp> host_lamps_;
  Buffer<vec3> positions_;
  Buffer<uvec3> triangles_;
  Buffer<vec3> normals_;
  Buffer<vec2> texture_coordinates_;
  Buffer<std::uint32_t> materials_;
  Buffer<Sphere> spheres_;
  Buffer<Plane> planes_;
  Buffer<WhittedMaterial> material_list_;
  Buffer<Medium> media_;
  Buffer<Lamp> lamps_;
  SceneTextures textures_;
};

}  // namespace trilha
