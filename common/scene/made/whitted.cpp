// The scenes that Ordeix & Cioli (2010) measured, as far as their thesis says what they are: how many
// objects, lights and triangles of each, and how they are spread. Places, colours, lights and cameras are
// ours: the files are lost, and their pictures are not described.

#include "common/math/turn.h"
#include "common/scene/made.h"
#include "common/scene/made/elephant.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

Material shiny(const char* name, const vec3& diffuse, float reflection) {
  Material material = coloured(name, diffuse);
  material.specular = vec3(0.4f);
  material.shininess = 60;
  material.reflection = vec3(reflection);
  material.roughness = 0.2f;
  return material;
}

constexpr std::uint32_t pri_triangles[5] = {194, 274, 348, 482, 606};

/// PRI_I to PRI_V: a sphere and a box, more and more finely.
Scene pri(const Parameters& parameters) {
  Scene scene;
  scene.name = "pri";
  scene.materials = {shiny("red", {0.75f, 0.16f, 0.10f}, 0.25f), shiny("blue", {0.20f, 0.38f, 0.70f}, 0.15f)};
  Mesh sphere = counted_sphere(pri_triangles[parameters.whole("number") - 1] - 12);
  sphere.name = "sphere";
  for (vec3& position : sphere.positions) position += vec3(-0.95f, 1, 0.2f);
  Mesh box;
  box.name = "box";
  add_box(box, {0.35, 0, -0.75}, {1.95, 1.6, 0.85}, 1, 28);
  scene.meshes = {std::move(sphere), std::move(box)};
  scene.lights = {point_light("left", {-4, 5, 4}, vec3(30)), point_light("right", {4, 6, 2}, vec3(20))};
  scene.ambient = vec3(0.1f);
  scene.camera = {{0.9f, 2.7f, 6.4f}, {0.16f, 0.85f, 0}, {0, 1, 0}, 33};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

/// DIST_I to DIST_III: nine elephants spread evenly, unevenly, and into each other. 9·1148 leave 6 of the
/// 10 338 triangles, of which the thesis says nothing: here a floor and two walls for the shadows.
Scene dist(const Parameters& parameters) {
  struct Place {
    double x, z, degrees;
  };
  static constexpr Place places[3][9] = {
      {{-5, -5, 20},
       {0, -5, -25},
       {5, -5, 10},
       {-5, 0, -15},
       {0, 0, 25},
       {5, 0, -35},
       {-5, 5, 35},
       {0, 5, -10},
       {5, 5, 15}},
      {{-5.4, -5.6, -20},
       {-2.6, -3.4, 15},
       {-6.0, -2.9, -5},
       {-2.2, -6.2, 5},
       {-5.2, -0.4, 25},
       {-1.6, -0.6, -30},
       {0.9, -3.6, 40},
       {-3.2, 2.0, -15},
       {5.2, 5.0, -160}},
      {{-1.8, -2.4, 0},
       {0.3, -1.3, 40},
       {1.7, 0.2, 80},
       {-0.6, 0.9, 120},
       {-2.5, 0.3, 160},
       {0.9, -3.3, 200},
       {-3.6, -1.6, 240},
       {-1.2, 2.7, 280},
       {2.9, -1.8, 320}},
  };
  Scene scene;
  scene.name = "dist";
  scene.materials = {coloured("skin", {0.52f, 0.54f, 0.60f}), coloured("ivory", {0.90f, 0.86f, 0.74f}),
                     coloured("eye", {0.03f, 0.03f, 0.03f}), coloured("floor", {0.62f, 0.52f, 0.36f}),
                     coloured("walls", {0.45f, 0.60f, 0.62f})};
  constexpr std::uint32_t floor = elephant_materials, walls = floor + 1;
  constexpr double side = 7.4, height = 5;
  Mesh room;
  room.name = "room";
  add_quad(room, {-side, 0, side}, {side, 0, side}, {side, 0, -side}, {-side, 0, -side}, floor);
  add_quad(room, {-side, 0, -side}, {side, 0, -side}, {side, height, -side}, {-side, height, -side}, walls);
  add_quad(room, {-side, 0, side}, {-side, 0, -side}, {-side, height, -side}, {-side, height, side}, walls);
  scene.meshes = {std::move(room), elephant()};
  scene.instances.push_back({0, -1, identity()});
  for (const Place& place : places[parameters.whole("number") - 1])
    scene.instances.push_back(
        {1, -1, translation({place.x, 0, place.z}) * linear(turned(1, place.degrees - 45))});
  scene.lights = {point_light("lamp", {6, 12, 5}, vec3(200))};
  scene.ambient = vec3(0.15f);
  scene.camera = {{17.5f, 11.5f, 15.5f}, {0, 0.2f, 0}, {0, 1, 0}, 38};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

/// ALEXANDRA: thirteen boxes of 12 triangles and a sphere of 80, rebuilt there by eye from the demonstration
/// of the Alexandra Institute. Here a stage and twelve blocks around a mirroring sphere.
Scene alexandra(const Parameters&) {
  Scene scene;
  scene.name = "alexandra";
  scene.materials = {shiny("sphere", {0.45f, 0.45f, 0.48f}, 0.5f), coloured("stage", {0.72f, 0.70f, 0.66f}),
                     coloured("terracotta", {0.70f, 0.30f, 0.18f}), coloured("ochre", {0.78f, 0.58f, 0.20f}),
                     coloured("sea", {0.16f, 0.42f, 0.52f})};
  Mesh sphere = smooth_icosphere(1, 1.1, {0, 1.1, 0});
  sphere.name = "sphere";
  Mesh boxes;
  boxes.name = "boxes";
  add_box(boxes, {-4.2, -0.3, -4.2}, {4.2, 0, 4.2}, 1);
  for (int i = 0; i < 12; ++i) {
    const auto [cosine, sine] = turn(30.0 * i + 15);
    const double height = i % 3 == 0 ? 1.5 : i % 3 == 1 ? 0.7 : 1.1;
    const dvec3 foot(3 * cosine, 0, -3 * sine);
    add_box(boxes, foot - dvec3(0.35, 0, 0.35), foot + dvec3(0.35, height, 0.35),
            2 + static_cast<std::uint32_t>(i % 3), 30.0 * i + 15);
  }
  scene.meshes = {std::move(sphere), std::move(boxes)};
  scene.lights = {point_light("lamp", {4, 8, 5}, vec3(70))};
  scene.ambient = vec3(0.12f);
  scene.camera = {{1.6f, 6.6f, 10.4f}, {0, 0.1f, 0}, {0, 1, 0}, 41};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

MadeSize pri_size(const Parameters& parameters) {
  const std::uint64_t triangles = pri_triangles[parameters.whole("number") - 1];
  return {triangles, triangles, 0, 0};
}
MadeSize dist_size(const Parameters&) { return {6 + 1148, 6 + 9 * 1148, 0, 0}; }
MadeSize alexandra_size(const Parameters&) { return {13 * 12 + 80, 13 * 12 + 80, 0, 0}; }

}  // namespace

std::vector<MadeScene> whitted_scenes() {
  return {{"pri",
           "a sphere and a box of 194, 274, 348, 482 or 606 triangles (Ordeix & Cioli 2010)",
           {{"number", "PRI_I to PRI_V: how finely", 1, 1, 5}},
           pri,
           pri_size},
          {"dist",
           "nine elephants, 10 338 triangles in all (Ordeix & Cioli 2010)",
           {{"number", "DIST_I to DIST_III: spread evenly, unevenly, into each other", 1, 1, 3}},
           dist,
           dist_size},
          {"alexandra",
           "thirteen boxes and a sphere, 236 triangles (Ordeix & Cioli 2010)",
           {},
           alexandra,
           alexandra_size}};
}

}  // namespace trilha
