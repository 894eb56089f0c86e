// The Cornell box as measured: Cornell University Program of Computer Graphics, "Cornell Box Data",
// https://www.graphics.cornell.edu/online/box/data.html (coordinates, camera, reflectances, emission).

#include "common/scene/made/shapes.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

enum CornellMaterial : std::uint32_t { white, red, green, panel, mirror, glass };

// The published spectra as linear Rec. 709: weighted with the CIE 1931 observer, from 400 to 700 nm in steps
// of 1 nm between the published values, the reflectances under D65. The test does that sum again.
constexpr vec3 white_reflectance{0.737f, 0.737f, 0.737f}, red_reflectance{0.489f, 0.051f, 0.051f},
    green_reflectance{0.069f, 0.399f, 0.086f};
constexpr vec3 panel_radiance{20.62f, 10.91f, 2.762f};
constexpr float panel_reflectance = 0.78f;

// Lengths are millimetres.
constexpr double ceiling = 548.8;
constexpr double panel_x[2] = {213, 343}, panel_z[2] = {227, 332};

Mesh walls(bool with_panel) {
  Mesh mesh;
  mesh.name = "room";
  add_quad(mesh, {552.8, 0, 0}, {0, 0, 0}, {0, 0, 559.2}, {549.6, 0, 559.2}, white);
  add_quad(mesh, {549.6, 0, 559.2}, {0, 0, 559.2}, {0, ceiling, 559.2}, {556, ceiling, 559.2}, white);
  add_quad(mesh, {0, 0, 559.2}, {0, 0, 0}, {0, ceiling, 0}, {0, ceiling, 559.2}, green);
  add_quad(mesh, {552.8, 0, 0}, {549.6, 0, 559.2}, {556, ceiling, 559.2}, {556, ceiling, 0}, red);
  // The panel was measured in the plane of the ceiling: this leaves out its rectangle, so that no point is on
  // both.
  const dvec3 outer[4] = {{556, ceiling, 0}, {556, ceiling, 559.2}, {0, ceiling, 559.2}, {0, ceiling, 0}};
  const dvec3 inner[4] = {{panel_x[1], ceiling, panel_z[0]},
                          {panel_x[1], ceiling, panel_z[1]},
                          {panel_x[0], ceiling, panel_z[1]},
                          {panel_x[0], ceiling, panel_z[0]}};
  for (int i = 0; i < 4; ++i)
    add_quad(mesh, outer[i], outer[(i + 1) % 4], inner[(i + 1) % 4], inner[i], white);
  add_quad(mesh, inner[0], inner[1], inner[2], inner[3], with_panel ? panel : white);
  return mesh;
}

/// A block on the floor, from the corners of its top as they are published, counter-clockwise
/// seen from above. It has no bottom.
Mesh block(const char* name, double height, const double (&corners)[4][2]) {
  Mesh mesh;
  mesh.name = name;
  const auto at = [&](int i, double y) { return dvec3(corners[i % 4][0], y, corners[i % 4][1]); };
  add_quad(mesh, at(0, height), at(1, height), at(2, height), at(3, height), white);
  for (int i = 0; i < 4; ++i) add_quad(mesh, at(i + 1, 0), at(i + 1, height), at(i, height), at(i, 0), white);
  return mesh;
}

Scene make(const Parameters& parameters) {
  const bool blocks = parameters.whole("blocks") == 1, spheres = parameters.whole("spheres") == 1;
  const bool lamp = parameters.whole("light") == 1;
  Scene scene;
  scene.name = "cornell_box";
  scene.materials = {coloured("white", white_reflectance), coloured("red", red_reflectance),
                     coloured("green", green_reflectance), coloured("panel", vec3(panel_reflectance)),
                     coloured("mirror", vec3(0.1f)),       coloured("glass", vec3(0.05f))};
  scene.materials[mirror].reflection = vec3(0.9f);
  scene.materials[mirror].roughness = 0;
  scene.materials[glass].reflection = vec3(0.1f);
  scene.materials[glass].transmission = vec3(0.85f);
  scene.materials[glass].roughness = 0;
  scene.meshes.push_back(walls(!lamp));
  if (blocks) {
    scene.meshes.push_back(block("short block", 165, {{130, 65}, {82, 225}, {240, 272}, {290, 114}}));
    scene.meshes.push_back(block("tall block", 330, {{423, 247}, {265, 296}, {314, 456}, {472, 406}}));
  }
  if (spheres) {
    // On the floor as in Jensen (1996); where there are blocks, on these.
    const double radius = blocks ? 80 : 100;
    const dvec3 places[2] = {blocks ? dvec3(368.5, 330 + radius, 351.25) : dvec3(400, radius, 370),
                             blocks ? dvec3(185.5, 165 + radius, 169) : dvec3(165, radius, 190)};
    for (const std::uint32_t material : {mirror, glass}) {
      const dvec3& centre = places[material - mirror];
      if (parameters.whole("analytic") == 1) {
        scene.spheres.push_back({centre, static_cast<float>(radius), material});
        continue;
      }
      Mesh mesh = smooth_icosphere(parameters.whole("subdivisions"), radius, centre);
      mesh.name = material == mirror ? "mirror" : "glass";
      mesh.materials.assign(mesh.triangles.size(), material);
      scene.meshes.push_back(std::move(mesh));
    }
  }
  if (lamp) {
    // What the panel sends straight down, as one point just below it sends it in every direction.
    const double area = (panel_x[1] - panel_x[0]) * (panel_z[1] - panel_z[0]);
    scene.lights = {point_light("panel", {278, 548, 279.5f}, vec3(area * dvec3(panel_radiance)))};
    scene.ambient = vec3(0.05f);
  } else {
    scene.materials[panel].emission = panel_radiance;
  }
  // A focal length of 0.035 and a film of 0.025: 2·atan(0.0125/0.035).
  scene.camera = {{278, 273, -800}, {278, 273, 0}, {0, 1, 0}, 39.30765f};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  constexpr std::uint64_t walls = 18, block = 10;
  const std::uint64_t spheres = 2 * static_cast<std::uint64_t>(parameters.whole("spheres"));
  const bool analytic = parameters.whole("analytic") == 1;
  std::uint64_t triangles = walls + 2 * block * static_cast<std::uint64_t>(parameters.whole("blocks"));
  if (!analytic) triangles += spheres * icosphere_triangles(parameters.whole("subdivisions"));
  return {triangles, triangles, analytic ? spheres : 0, 0};
}

}  // namespace

MadeScene cornell_box_scene() {
  return {
      "cornell_box",
      "the Cornell box as measured, in millimetres; light=point for chapters whose lights are points",
      {{"blocks", "the two blocks", 1, 0, 1},
       {"spheres", "a mirror and a ball of glass", 0, 0, 1},
       {"light", "the panel gives off light, or a point below it does", 0, 0, 1, true, {"panel", "point"}},
       {"analytic", "spheres as spheres instead of triangles", 0, 0, 1},
       {"subdivisions", "of the spheres' triangles: 20·4^n each", 4, 0, 8}},
      make,
      size};
}

}  // namespace trilha
