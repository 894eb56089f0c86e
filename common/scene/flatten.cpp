#include "common/scene/flatten.h"

#include <unistd.h>

#include <cmath>
#include <optional>
#include <stdexcept>

#include "common/error.h"

namespace trilha {
namespace {

constexpr std::size_t most = most_triangles;  // and vertices

constexpr std::size_t most_multiplied = std::size_t{1} << 24;  // a small file names many instances easily

/// Refuses what 32-bit numbers cannot name or memory cannot hold.
void check_size(const Scene& scene, const MeshParts& parts) {
  const std::size_t vertices = scene.vertex_count(), triangles = scene.triangle_count();
  if (triangles > most || vertices > most)
    throw InputError(scene.name + ": " + std::to_string(triangles) + " triangles with " +
                     std::to_string(vertices) +
                     " vertices; a structure without instances takes up to 4294967294 of each");
  std::size_t stored = 0;
  for (const Mesh& mesh : scene.meshes) stored += mesh.triangles.size();
  if (triangles > stored + most_multiplied)
    throw InputError(scene.name + ": its instances make " + std::to_string(triangles) + " of " +
                     std::to_string(stored) + " triangles; a structure without instances takes up to " +
                     std::to_string(most_multiplied) + " more than there are");
  const double vertex = sizeof(vec3) * (parts.normals ? 2 : 1) + sizeof(vec2) * parts.texture_coordinates;
  const double triangle = sizeof(uvec3) + sizeof(std::uint32_t) * parts.materials;
  const double needed = vertex * double(vertices) + triangle * double(triangles);
  const double there = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
  if (there > 0 && needed > there) {
    const auto gigabytes = [](double bytes) { return std::to_string(std::llround(bytes / 1e9)) + " GB"; };
    throw InputError(scene.name + ": its instances as single triangles take " + gigabytes(needed) +
                     ", this machine has " + gigabytes(there) + "; a smaller scene fits");
  }
}

class Flat {
 public:
  Flat(const Scene& scene, const MeshParts& parts) : scene_(scene), parts_(parts) {
    mesh.name = scene.name;
    mesh.positions.reserve(scene.vertex_count());
    mesh.triangles.reserve(scene.triangle_count());
    if (parts.normals) mesh.normals.reserve(scene.vertex_count());
    if (parts.texture_coordinates) mesh.texture_coordinates.reserve(scene.vertex_count());
    if (parts.materials) mesh.materials.reserve(scene.triangle_count());
    if (parts.normals) made_normals_.resize(scene.meshes.size());
  }

  void add(const Mesh& from, const Instance* instance) {
    const auto offset = static_cast<std::uint32_t>(mesh.positions.size());
    const bool mirrored = instance != nullptr && mirrors(instance->transform);
    if (instance == nullptr) {
      mesh.positions.insert(mesh.positions.end(), from.positions.begin(), from.positions.end());
    } else {
      for (const vec3& position : from.positions) {
        const vec3 p(apply(instance->transform, dvec3(position)));
        if (!(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)))
          throw InputError(scene_.name + ": an instance of '" + from.name +
                           "' reaches beyond the largest float, 3.4e38; scale it down");
        mesh.positions.push_back(p);
      }
    }
    for (const uvec3& t : from.triangles)
      mesh.triangles.push_back((mirrored ? uvec3(t.x, t.z, t.y) : t) + offset);
    if (parts_.normals) add_normals(from, instance);
    if (parts_.texture_coordinates) {
      const auto& uvs = from.texture_coordinates;
      mesh.texture_coordinates.insert(mesh.texture_coordinates.end(), uvs.begin(), uvs.end());
      mesh.texture_coordinates.resize(mesh.positions.size(), vec2(0));
    }
    if (parts_.materials) {
      if (instance != nullptr && instance->material >= 0) {
        mesh.materials.resize(mesh.triangles.size(), static_cast<std::uint32_t>(instance->material));
      } else {
        mesh.materials.insert(mesh.materials.end(), from.materials.begin(), from.materials.end());
        mesh.materials.resize(mesh.triangles.size(), 0);
      }
    }
  }

  Mesh mesh;

 private:
  void add_normals(const Mesh& from, const Instance* instance) {
    const std::vector<vec3>* normals = &from.normals;
    if (normals->empty()) {
      std::vector<vec3>& made = made_normals_[static_cast<std::size_t>(&from - scene_.meshes.data())];
      if (made.empty() && !from.positions.empty()) {
        Mesh copy{"", from.positions, from.triangles, {}, {}, {}};
        make_normals(copy);
        made = std::move(copy.normals);
      }
      normals = &made;
    }
    if (instance == nullptr) {
      mesh.normals.insert(mesh.normals.end(), normals->begin(), normals->end());
      return;
    }
    glm::dmat3 turn = cofactors(instance->transform);  // not scaled: 1e150 would overflow its squares
    double size = 0;
    for (int i = 0; i < 9; ++i) size = std::max(size, std::abs(turn[i / 3][i % 3]));
    turn /= mirrors(instance->transform) ? -size : size;  // so that outside stays outside
    for (const vec3& normal : *normals) {
      const dvec3 turned = turn * dvec3(normal);
      const double length = glm::length(turned);
      mesh.normals.push_back(length > 0 ? vec3(turned / length) : normal);
    }
  }

  const Scene& scene_;
  const MeshParts& parts_;
  std::vector<std::vector<vec3>> made_normals_;  // once for all instances of a mesh
};

}  // namespace

Mesh flattened(const Scene& scene, const MeshParts& parts) {
  check_size(scene, parts);
  Flat flat(scene, parts);
  if (scene.instances.empty()) {
    for (const Mesh& mesh : scene.meshes) flat.add(mesh, nullptr);
  } else {
    for (const Instance& instance : scene.instances) flat.add(scene.meshes[instance.mesh], &instance);
  }
  return std::move(flat.mesh);
}

FlatTriangle flat_triangle(const Scene& scene, std::uint32_t number) {
  std::size_t left = number;
  const auto find = [&](const Mesh& mesh, const Instance* instance) -> std::optional<FlatTriangle> {
    if (left >= mesh.triangles.size()) {
      left -= mesh.triangles.size();
      return {};
    }
    uvec3 t = mesh.triangles[left];
    if (instance != nullptr && mirrors(instance->transform)) t = uvec3(t.x, t.z, t.y);
    const auto placed = [&](std::uint32_t vertex) {
      const vec3& p = mesh.positions[vertex];
      return instance == nullptr ? p : vec3(apply(instance->transform, dvec3(p)));
    };
    std::uint32_t material = mesh.materials.empty() ? 0 : mesh.materials[left];
    if (instance != nullptr && instance->material >= 0)
      material = static_cast<std::uint32_t>(instance->material);
    return FlatTriangle{placed(t.x), placed(t.y), placed(t.z), material, &mesh};
  };
  if (scene.instances.empty()) {
    for (const Mesh& mesh : scene.meshes)
      if (const auto found = find(mesh, nullptr)) return *found;
  } else {
    for (const Instance& instance : scene.instances)
      if (const auto found = find(scene.meshes[instance.mesh], &instance)) return *found;
  }
  throw std::out_of_range(scene.name + " has no triangle " + std::to_string(number));
}

}  // namespace trilha
