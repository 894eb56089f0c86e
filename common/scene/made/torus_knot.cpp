#include <numeric>

#include "common/math/turn.h"
#include "common/scene/made/shapes.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

/// The closed curve that goes p times around the axis and q times around the tube of a torus of radii 2 and
/// 1; p and q have no common divisor. i of n steps have been gone; `start` turns it around the tube.
struct Knot {
  std::int64_t p, q, n;
  double start;

  struct Point {
    dvec3 position, along, outwards;  // outwards: from the torus, of length one, at right angles to along
  };

  Point at(std::int64_t i) const {
    const Turn around = turn(360.0 * static_cast<double>(p * i % n) / static_cast<double>(n));
    const Turn over = turn(360.0 * static_cast<double>(q * i % n) / static_cast<double>(n) + start);
    const double radius = 2 + over.cosine;
    const dvec3 radial(around.cosine, around.sine, 0), tangential(-around.sine, around.cosine, 0);
    const dvec3 up(0, 0, 1);
    return {
        radius * radial + over.sine * up,
        glm::normalize(double(p) * radius * tangential + double(q) * (over.cosine * up - over.sine * radial)),
        over.cosine * radial + over.sine * up};
  }
};

/// The points at that distance from the curve. Their normals are exact: the tube's surface stands at right
/// angles to the way from the curve, however the sections are turned.
void add_tube(Mesh& mesh, const Knot& knot, std::uint32_t sides, double radius) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const auto n = static_cast<std::uint32_t>(knot.n);
  for (std::uint32_t i = 0; i < n; ++i) {
    const Knot::Point centre = knot.at(i);
    const dvec3 sideways = glm::cross(centre.along, centre.outwards);
    for (std::uint32_t j = 0; j < sides; ++j) {
      const auto [cosine, sine] = turn(360.0 * j / sides);
      const dvec3 normal = cosine * centre.outwards + sine * sideways;
      mesh.positions.push_back(centre.position + radius * normal);
      mesh.normals.push_back(normal);
    }
  }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < sides; ++j) {
      const auto vertex = [&](std::uint32_t a, std::uint32_t b) { return first + a % n * sides + b % sides; };
      mesh.triangles.push_back({vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1)});
      mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i + 1, j)});
    }
}

Scene make(const Parameters& parameters) {
  const std::int64_t p = parameters.whole("p"), q = parameters.whole("q"), strands = std::gcd(p, q);
  const std::int64_t segments = parameters.whole("segments") / strands;
  const auto sides = static_cast<std::uint32_t>(parameters.whole("sides"));
  const vec3 colours[4] = {
      {0.80f, 0.42f, 0.18f}, {0.20f, 0.50f, 0.62f}, {0.62f, 0.66f, 0.28f}, {0.60f, 0.26f, 0.42f}};
  Scene scene;
  scene.name = "torus_knot";
  const auto count = static_cast<std::size_t>(segments * sides);
  for (std::int64_t strand = 0; strand < strands; ++strand) {
    // Where p and q have a common divisor there are as many closed curves, side by side.
    Mesh mesh;
    mesh.name = "strand " + std::to_string(strand + 1);
    mesh.positions.reserve(count);
    mesh.normals.reserve(count);
    mesh.triangles.reserve(2 * count);
    add_tube(mesh, {p / strands, q / strands, segments, 360.0 * double(strand) / double(p)}, sides,
             parameters["radius"]);
    if (strand > 0) mesh.materials.assign(mesh.triangles.size(), static_cast<std::uint32_t>(strand));
    scene.meshes.push_back(std::move(mesh));
    Material material = coloured(scene.meshes.back().name, colours[strand % 4]);
    material.specular = vec3(0.4f);
    material.shininess = 80;
    material.roughness = 0.25f;
    scene.materials.push_back(material);
  }
  scene.lights = {point_light("lamp", {-5, -6, 9}, vec3(120)), point_light("fill", {8, 2, 4}, vec3(30))};
  scene.ambient = vec3(0.1f);
  scene.camera = {{1.6f, -7.2f, 6.4f}, {0, -0.25f, 0}, {0, 0, 1}, 36};
  finish(scene, {0, 0, 1}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  const auto whole = [&](const char* name) { return static_cast<std::uint64_t>(parameters.whole(name)); };
  const std::uint64_t triangles = 2 * whole("segments") * whole("sides");
  return {triangles, triangles, 0, 0};
}

}  // namespace

MadeScene torus_knot_scene() {
  return {"torus_knot",
          "a tube around a torus knot, 2·segments·sides triangles; segments=5000,sides=100 is a million",
          {{"p", "how often it goes around the axis", 2, 1, 20},
           {"q", "how often it goes around the tube of the torus", 3, 1, 20},
           {"radius", "of the tube; the torus has radii 2 and 1", 0.35, 0.001, 0.9, false},
           {"segments", "along the knot", 600, 60, 20000},
           {"sides", "around the tube", 48, 3, 250}},
          make,
          size};
}

}  // namespace trilha
