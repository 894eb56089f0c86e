// OBJ files, alone. What is taken is a scene that no chapter stumbles over.

#include <cmath>

#include "common/scene/obj.h"
#include "tests/fuzz/fuzz.h"

namespace {

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

void check(const trilha::Scene& scene) {
  for (const trilha::Mesh& mesh : scene.meshes) {
    const std::size_t n = mesh.positions.size();
    for (const trilha::uvec3& t : mesh.triangles) require(t.x < n && t.y < n && t.z < n, "vertices exist");
    for (const trilha::vec3& p : mesh.positions)
      require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z), "positions are finite");
    for (const trilha::vec3& v : mesh.normals)
      require(std::abs(glm::length(trilha::dvec3(v)) - 1) < 1e-6, "normals have length one");
    require(mesh.normals.empty() || mesh.normals.size() == n, "a normal a vertex");
    require(mesh.texture_coordinates.empty() || mesh.texture_coordinates.size() == n,
            "a coordinate a vertex");
    require(mesh.materials.empty() || mesh.materials.size() == mesh.triangles.size(),
            "a material a triangle");
    for (const std::uint32_t m : mesh.materials) require(m < scene.materials.size(), "materials exist");
  }
  for (const trilha::Plane& plane : scene.planes) {
    require(plane.material < scene.materials.size(), "materials exist");
    require(std::isfinite(plane.offset), "planes are finite");
  }
  for (const trilha::Sphere& sphere : scene.spheres) {
    require(sphere.material < scene.materials.size(), "materials exist");
    require(sphere.radius > 0 && std::isfinite(sphere.radius), "spheres are finite");
  }
  require(scene.camera.eye != scene.camera.target, "the camera looks somewhere");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.obj", data, size),
                                        [](const std::string& path) { check(trilha::load_obj(path)); });
}
