// The sphereflake of Haines' standard procedural databases ("A Proposal for Standard Graphics Environments",
// IEEE CG&A 7(11), 1987), where it is called "balls": on each sphere nine of a third of its size.

#include <cmath>

#include "common/math/turn.h"
#include "common/scene/made/shapes.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

enum FlakeMaterial : std::uint32_t { ball, floor };

/// The rotation that takes +z to the direction at that azimuth and that angle from z, the short way.
glm::dmat3 towards(double azimuth, const glm::dmat3& tilt) {
  return turned(2, azimuth) * tilt * turned(2, -azimuth);
}

/// Rotations of nine children against their parent: six around its equator, three above, each of these 60°
/// from its two nearest of the six.
std::vector<glm::dmat3> children() {
  const double cosine = std::sqrt(2.0 / 3), sine = std::sqrt(1.0 / 3);  // of the upper ones' angle from z
  const glm::dmat3 level = turned(1, 90), raised(cosine, 0, -sine, 0, 1, 0, sine, 0, cosine);
  std::vector<glm::dmat3> rotations;
  for (int third = 0; third < 3; ++third) {
    rotations.push_back(towards(120.0 * third - 30, level));
    rotations.push_back(towards(120.0 * third + 30, level));
    rotations.push_back(towards(120.0 * third, raised));
  }
  return rotations;
}

/// The flake level by level; `place(level, centre, radius, frame)` gets each sphere.
template <class Place>
void grow(int levels, const Place& place) {
  struct Ball {
    dvec3 centre;
    glm::dmat3 frame;  // its columns, of length one; z points away from the parent
  };
  const std::vector<glm::dmat3> rotations = children();
  std::vector<Ball> level{{dvec3(0), glm::dmat3(1)}};
  double radius = 0.5;
  place(0, level[0].centre, radius, level[0].frame);
  for (int depth = 1; depth <= levels; ++depth) {
    std::vector<Ball> next;
    if (depth < levels) next.reserve(9 * level.size());
    for (const Ball& parent : level)
      for (const glm::dmat3& rotation : rotations) {
        const glm::dmat3 frame = parent.frame * rotation;
        const dvec3 centre = parent.centre + 4.0 / 3 * radius * frame[2];
        place(depth, centre, radius / 3, frame);
        if (depth < levels) next.push_back({centre, frame});  // the last level bears none
      }
    level = std::move(next);
    radius /= 3;
  }
}

/// Of the spheres on that level.
int subdivisions(const Parameters& parameters, int level) {
  return std::max(parameters.whole("subdivisions") - level * parameters.whole("coarser"), 0);
}

Scene make(const Parameters& parameters) {
  const int levels = parameters.whole("level");
  Scene scene;
  scene.name = "sphereflake";
  scene.materials = {coloured("ball", {0.9f, 0.66f, 0.5f}), coloured("floor", {0.8f, 0.6f, 0.264f})};
  scene.materials[ball].diffuse = vec3(0.5f, 0.45f, 0.35f);  // kd 0.5, ks 0.5 of (1, 0.9, 0.7)
  scene.materials[ball].specular = scene.materials[ball].reflection = vec3(0.5f, 0.45f, 0.35f);
  scene.materials[ball].shininess = 3.0827f;
  scene.materials[ball].roughness = 0;

  Mesh ground;
  ground.name = "floor";
  add_quad(ground, {-6, -6, -0.5}, {6, -6, -0.5}, {6, 6, -0.5}, {-6, 6, -0.5}, floor);
  scene.meshes.push_back(std::move(ground));
  if (parameters.whole("analytic") == 1) {
    grow(levels, [&](int, const dvec3& centre, double radius, const glm::dmat3&) {
      scene.spheres.push_back({centre, static_cast<float>(radius), ball});
    });
  } else {
    std::size_t count = 2, on_level = 1;  // the floor first
    for (int depth = 0; depth <= levels; ++depth, on_level *= 9) {
      scene.meshes.push_back(smooth_icosphere(subdivisions(parameters, depth)));
      count += on_level;
    }
    scene.instances.reserve(count);
    scene.instances.push_back({0, -1, identity()});
    grow(levels, [&](int depth, const dvec3& centre, double radius, const glm::dmat3& frame) {
      scene.instances.push_back(
          {1 + static_cast<std::uint32_t>(depth), -1, translation(centre) * linear(radius * frame)});
    });
  }
  for (const vec3& position : {vec3(4, 3, 2), vec3(1, -4, 4), vec3(-3, 1, 5)})
    scene.lights.push_back(point_light("", position, vec3(0.577f), {1, 0, 0}));  // 1/√3, as far away as near
  scene.environment.colour = {0.078f, 0.361f, 0.753f};
  scene.camera = {{2.1f, 1.3f, 1.7f}, {0, 0, 0}, {0, 0, 1}, 45};
  finish(scene, {0, 0, 1}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  MadeSize size{2, 2, 0, 0};  // the floor
  std::uint64_t on_level = 1;
  for (int level = 0; level <= parameters.whole("level"); ++level, on_level *= 9) {
    if (parameters.whole("analytic") == 1) {
      size.bodies += on_level;
      continue;
    }
    const std::uint64_t triangles = icosphere_triangles(subdivisions(parameters, level));
    size.stored += triangles;
    size.placed += on_level * triangles;
  }
  return size;
}

}  // namespace

MadeScene sphereflake_scene() {
  return {"sphereflake",
          "spheres on spheres (Haines 1987): (9^(level+1) − 1)/8 of them",
          {{"level", "how often spheres have grown on spheres", 3, 0, 7},
           {"analytic", "spheres as spheres instead of triangles", 0, 0, 1},
           {"subdivisions", "of the largest sphere's triangles: 20·4^n", 4, 0, 7},
           {"coarser", "by how many subdivisions each level is coarser than its parents'", 1, 0, 7}},
          make,
          size};
}

}  // namespace trilha
