// A still life of glass and silver, in the tradition of Whitted's picture ("An Improved Illumination Model
// for Shaded Display", CACM 23(6), 1980): all that his equation adds to a surface, from few enough triangles
// to ask every one of them.

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/turn.h"
#include "common/scene/library.h"
#include "common/scene/made.h"
#include "common/scene/made/build.h"
#include "common/scene/made/solids.h"
#include "common/scene/newell.h"

namespace trilha {
namespace {

// A unit is some 6 cm; y is up, the board's top is y = 0.

/// Air between what stands and what it stands on: faces of different media never coincide.
constexpr double gap = 0.004;

enum StillLifeMaterial : std::uint32_t {
  ground,
  ivory,
  slate,
  edge,
  backdrop,
  stone,
  silver,
  mirror,
  frame,
  crystal,
  air,
  window_glass,
  water,
  gem,
  amber,
  sapphire,
  emerald,
  ruby,
  red_lacquer,
  green_lacquer,
  pearl,
  straw_white,
  straw_red,
  softbox,
  warm_card,
  material_count
};

/// All that is to be tuned of surfaces.
std::vector<Material> make_materials() {
  std::vector<Material> list(material_count);
  const auto matt = [&](StillLifeMaterial which, const char* name, const vec3& diffuse) -> Material& {
    list[which] = coloured(name, diffuse);
    return list[which];
  };
  const auto polished = [&](StillLifeMaterial which, const char* name, const vec3& diffuse,
                            const vec3& specular, float shininess, const vec3& reflection) {
    Material& material = matt(which, name, diffuse);
    material.specular = specular;
    material.shininess = shininess;
    material.reflection = reflection;
    material.roughness = 0;
  };
  // What mirrors and transmits at once: k_s and k_t are those of Whitted's equation, constants.
  const auto clear = [&](StillLifeMaterial which, const char* name, float index, float reflection,
                         float transmission, const vec3& absorption) {
    polished(which, name, vec3(0), vec3(0.6f), 400, vec3(reflection));
    list[which].transmission = vec3(transmission);
    list[which].refraction_index = index;
    list[which].absorption = absorption;
  };
  matt(ground, "ground", {0.035f, 0.032f, 0.035f});
  polished(ivory, "ivory", {0.80f, 0.74f, 0.62f}, vec3(0.10f), 60, vec3(0.07f));
  polished(slate, "slate", {0.055f, 0.085f, 0.11f}, vec3(0.25f), 90, vec3(0.12f));
  polished(edge, "edge", {0.20f, 0.11f, 0.06f}, vec3(0.10f), 40, vec3(0));
  matt(backdrop, "backdrop", {0.20f, 0.25f, 0.33f});
  matt(stone, "stone", {0.62f, 0.58f, 0.52f});
  polished(silver, "silver", {0.04f, 0.039f, 0.037f}, vec3(0.7f), 180, {0.86f, 0.84f, 0.79f});
  polished(mirror, "mirror", vec3(0.01f), vec3(0), 0, {0.88f, 0.90f, 0.89f});
  polished(frame, "brass", {0.34f, 0.21f, 0.07f}, {0.75f, 0.55f, 0.25f}, 50, {0.28f, 0.19f, 0.08f});
  clear(crystal, "crystal", 1.52f, 0.08f, 0.92f, {0.03f, 0.015f, 0.02f});
  clear(air, "air in glass", 1, 0.05f, 0.95f, vec3(0));
  clear(window_glass, "glass", 1.5f, 0.07f, 0.93f, {0.12f, 0.05f, 0.07f});
  clear(water, "water", 1.333f, 0.03f, 0.97f, {0.32f, 0.10f, 0.05f});
  clear(gem, "gem", 1.9f, 0.12f, 0.88f, {1.9f, 0.3f, 0.85f});
  clear(amber, "amber", 1.54f, 0.07f, 0.93f, {0.25f, 1.9f, 6.5f});
  clear(sapphire, "sapphire", 1.6f, 0.08f, 0.92f, {9.0f, 4.2f, 0.6f});
  clear(emerald, "emerald", 1.57f, 0.08f, 0.92f, {8.0f, 0.8f, 4.6f});
  clear(ruby, "ruby", 1.7f, 0.09f, 0.91f, {0.6f, 10.0f, 7.5f});
  polished(red_lacquer, "red lacquer", {0.62f, 0.035f, 0.03f}, vec3(0.8f), 260, vec3(0.10f));
  polished(green_lacquer, "green lacquer", {0.03f, 0.26f, 0.20f}, vec3(0.8f), 260, vec3(0.10f));
  polished(pearl, "pearl", {0.80f, 0.76f, 0.72f}, vec3(0.45f), 50, vec3(0.06f));
  matt(straw_white, "straw, white", {0.85f, 0.83f, 0.78f});
  matt(straw_red, "straw, red", {0.75f, 0.09f, 0.08f});
  matt(softbox, "softbox", vec3(0.2f)).emission = {2.6f, 2.5f, 2.35f};
  matt(warm_card, "warm card", vec3(0.2f)).emission = {0.85f, 0.50f, 0.24f};
  return list;
}

/// What the studio has beside its lights, which are points: faces that give light to nothing but the eye, for
/// silver and glass to show.
struct Softbox {
  dvec3 centre, across, up;  ///< half its sides; it gives light where across × up points
  StillLifeMaterial material = softbox;
};
const Softbox softboxes[] = {{{-4.6, 7.6, 6.2}, {1.5, 0, 1.05}, {0.55, 1.0, -0.8}},
                             {{7.4, 3.4, 5.4}, {0.5, 0, -0.65}, {0, 2.4, 0}},
                             {{-1.2, 9.5, -1.6}, {2.6, 0, 0}, {0, 0, 1.4}},
                             {{-9.5, 2.6, 2.0}, {0, 0, -2.6}, {0, 2.6, 0}, warm_card}};

void add_lights(Scene& scene) {
  scene.lights.push_back(point_light("key", {-3.9f, 6.7f, 5.3f}, {82, 76, 66}));
  Light glow;
  glow.name = "glow on the backdrop";
  glow.kind = Light::Kind::spot;
  glow.position = {1.3f, 0.5f, -6.9f};
  glow.direction = glm::normalize(vec3(0, 0.12f, -1));
  glow.intensity = {34, 17, 7};
  glow.inner_angle = 0;
  glow.outer_angle = 80;
  scene.lights.push_back(glow);
  Light fill;
  fill.name = "fill";
  fill.kind = Light::Kind::directional;
  fill.direction = glm::normalize(vec3(-0.42f, -1, -0.62f));
  fill.intensity = {0.20f, 0.25f, 0.34f};
  scene.lights.push_back(fill);
  scene.ambient = {0.11f, 0.125f, 0.16f};
  scene.environment.colour = {0.055f, 0.075f, 0.12f};
}

/// The mesh without texture coordinates, which nothing here needs.
Mesh bare(MeshBuilder& builder) {
  Mesh mesh = builder.take();
  mesh.texture_coordinates = {};
  return mesh;
}

/// Squares of one unit in two kinds of stone, with edges down to the ground.
Mesh board() {
  constexpr int left = -8, right = 8, back = -6, front = 4;
  constexpr double low = -0.08;
  Mesh mesh;
  mesh.name = "board";
  for (int z = back; z < front; ++z)
    for (int x = left; x < right; ++x)
      add_quad(mesh, {x, 0, z + 1}, {x + 1, 0, z + 1}, {x + 1, 0, z}, {x, 0, z},
               ((x ^ z) & 1) != 0 ? slate : ivory);
  add_quad(mesh, {left, low, front}, {right, low, front}, {right, 0, front}, {left, 0, front}, edge);
  add_quad(mesh, {right, low, back}, {left, low, back}, {left, 0, back}, {right, 0, back}, edge);
  add_quad(mesh, {left, low, back}, {left, low, front}, {left, 0, front}, {left, 0, back}, edge);
  add_quad(mesh, {right, low, front}, {right, low, back}, {right, 0, back}, {right, 0, front}, edge);
  return mesh;
}
constexpr std::uint64_t board_triangles = 2 * 16 * 10 + 8;

/// Paper that hangs down and runs out on the ground, as photographers have it.
Mesh sweep_of_paper() {
  constexpr double half = 34, low = -0.05, turn_at = 3;
  constexpr int curve = 8;
  MeshBuilder builder("backdrop");
  builder.material(backdrop).grid(1, curve + 2, [&](int i, int j) {
    const double x = i == 0 ? -half : half;
    if (j == 0) return Vertex{{x, low, -6.02}, {0, 1, 0}, dvec2(0)};
    if (j == curve + 2) return Vertex{{x, 12, -7.4 - turn_at}, {0, 0, 1}, dvec2(0)};
    const auto [cosine, sine] = turn(90.0 * (j - 1) / curve);
    return Vertex{{x, low + turn_at * (1 - cosine), -7.4 - turn_at * sine}, {0, cosine, sine}, dvec2(0)};
  });
  return bare(builder);
}
constexpr std::uint64_t backdrop_triangles = 2 * 10;

constexpr int around = 40;  // corners of what is turned

/// A tumbler's glass: its outside, its rim and its inside are one closed surface.
Mesh tumbler(const dvec3& foot) {
  const double quarter = std::sqrt(2.0) - 1;
  Profile profile({0, 0});
  profile.line({0.46, 0}).arc({0.52, 0.06}, quarter, 2).line({0.62, 1.7}).arc({0.56, 1.7}, 1, 4);
  profile.line({0.47, 0.22}).arc({0.41, 0.16}, -quarter, 2).line({0, 0.16});
  MeshBuilder builder("tumbler");
  builder.material(window_glass).lathe(profile, around, 1, 1, foot);
  return bare(builder);
}

/// The water in it reaches 0.022 into the glass: were both surfaces one, rays would not know which they cross
/// first, and with a gap there would be air.
Mesh water_in_tumbler(const dvec3& foot) {
  const double quarter = std::sqrt(2.0) - 1;
  Profile profile({0, 0.138});
  profile.line({0.41, 0.138}).arc({0.492, 0.22}, quarter, 2).line({0.5425, 1.05}).line({0, 1.05});
  MeshBuilder builder("water");
  builder.material(water).lathe(profile, around, 1, 1, foot);
  return bare(builder);
}
constexpr std::uint64_t tumbler_triangles = around * (1 + 4 + 2 + 8 + 2 + 4 + 1),
                        water_triangles = around * (1 + 4 + 2 + 1);

/// A striped straw, bent by nothing but the water.
Mesh straw(const dvec3& foot) {
  constexpr int sides = 8, rings = 16;
  constexpr double radius = 0.045;
  const dvec3 low = foot + dvec3(-0.36, 0.23, 0.06), high = foot + dvec3(0.79, 2.3, -0.10);
  const dvec3 along = glm::normalize(high - low), across = glm::normalize(glm::cross(along, dvec3(0, 0, 1)));
  const dvec3 up = glm::cross(across, along);
  const auto out = [&](int i) {
    const auto [cosine, sine] = turn(360.0 * (i % sides) / sides);
    return cosine * across + sine * up;
  };
  const auto at = [&](int i, int j) { return low + (high - low) * (double(j) / rings) + radius * out(i); };
  MeshBuilder builder("straw");
  for (int j = 0; j < rings; ++j)
    for (int i = 0; i < sides; ++i)
      builder.material((i + j) % 4 < 2 ? straw_red : straw_white).grid(1, 1, [&](int a, int b) {
        // across × up points back along the straw: i goes the other way round
        return Vertex{at(i + 1 - a, j + b), out(i + 1 - a), dvec2(0)};
      });
  builder.material(straw_white);
  builder.grid(sides, 1, [&](int i, int j) {
    return Vertex{j == 0 ? at(sides - i, rings) : high, along, dvec2(0)};
  });
  builder.grid(sides, 1, [&](int i, int j) { return Vertex{j == 0 ? at(i, 0) : low, -along, dvec2(0)}; });
  return bare(builder);
}
constexpr std::uint64_t straw_triangles = 2 * 8 * 16 + 2 * 8;

/// A brilliant of 62 triangles with flat facets, which lies on one of those of its pavilion, turned about the
/// vertical by that many degrees.
Mesh brilliant(double size, const dvec3& foot, double degrees) {
  constexpr int corners = 8;
  const auto circle = [&](double radius, double y, double shift) {
    std::vector<dvec3> points;
    for (int i = 0; i < corners; ++i) {
      const auto [cosine, sine] = turn(360.0 * (i + shift) / corners);
      points.push_back(size * dvec3(radius * sine, y, radius * cosine));
    }
    return points;
  };
  const std::vector<dvec3> table = circle(0.56, 0.34, 0), girdle = circle(1, 0.05, 0.5),
                           below = circle(1, -0.02, 0.5), keel = circle(0.52, -0.43, 0);
  const dvec3 culet = size * dvec3(0, -0.82, 0);
  std::vector<std::array<dvec3, 3>> facets;
  for (std::size_t i = 0; i < corners; ++i) {
    const std::size_t next = (i + 1) % corners, last = (i + corners - 1) % corners;
    if (i > 1) facets.push_back({table[0], table[i - 1], table[i]});
    facets.push_back({table[i], girdle[last], girdle[i]});
    facets.push_back({table[i], girdle[i], table[next]});
    facets.push_back({girdle[i], below[i], below[next]});
    facets.push_back({girdle[i], below[next], girdle[next]});
    facets.push_back({below[last], keel[i], below[i]});
    facets.push_back({below[i], keel[i], keel[next]});
    facets.push_back({keel[i], culet, keel[next]});
  }
  // Turns the way down from its heaviest facet to straight down: the short way, by Rodrigues' formula.
  const auto normal = [](const std::array<dvec3, 3>& f) {
    return glm::normalize(glm::cross(f[1] - f[0], f[2] - f[0]));
  };
  const dvec3 from = normal({below[corners - 1], keel[0], below[0]}), down(0, -1, 0);
  const dvec3 axis = glm::cross(from, down);
  const double cosine = glm::dot(from, down);
  const glm::dmat3 upright = turned(1, degrees);
  const auto turned_down = [&](const dvec3& p) {
    return upright * (cosine * p + glm::cross(axis, p) + axis * (glm::dot(axis, p) / (1 + cosine)));
  };
  double lowest = 0;
  for (auto& facet : facets)
    for (dvec3& p : facet) p = turned_down(p), lowest = std::min(lowest, p.y);
  Mesh mesh;
  mesh.name = "gem";
  for (const auto& facet : facets) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const dvec3& p : facet) {
      mesh.positions.push_back(p + foot - dvec3(0, lowest, 0));
      mesh.normals.push_back(normal(facet));
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  mesh.materials.assign(mesh.triangles.size(), gem);
  return mesh;
}
constexpr std::uint64_t gem_triangles = 6 + 7 * 8;

/// Newell's teapot on y = 0.
Mesh teapot(int quads, const dvec3& foot, double scale, double degrees) {
  Mesh mesh = tessellate(load_bpt((root_folder() / "assets" / "newell" / "teapot.bpt").string()), quads);
  mesh.name = "teapot";
  const glm::dmat3 rotation = turned(1, degrees) * turned(0, -90);  // it comes with z up
  double lowest = INFINITY;
  for (const vec3& p : mesh.positions) lowest = std::min(lowest, scale * double(p.z));
  for (vec3& p : mesh.positions) p = vec3(rotation * (scale * dvec3(p)) + foot - dvec3(0, lowest, 0));
  for (vec3& n : mesh.normals) n = vec3(rotation * dvec3(n));
  mesh.materials.assign(mesh.triangles.size(), silver);
  return mesh;
}

/// A glass in a frame, turned about the vertical; its middle stands on `foot`.
Mesh standing_mirror(const dvec3& foot, double width, double height, double degrees) {
  constexpr double bar = 0.16, deep = 0.09;
  Mesh mesh;
  mesh.name = "mirror";
  const glm::dmat3 rotation = turned(1, degrees);
  const auto box = [&](const dvec3& lower, const dvec3& upper, std::uint32_t material) {
    Mesh piece;
    add_box(piece, lower, upper, material);
    for (vec3& p : piece.positions) p = vec3(rotation * dvec3(p) + foot);
    for (vec3& n : piece.normals) n = vec3(rotation * dvec3(n));
    add_piece(mesh, piece, material);
  };
  const double x = width / 2, inner = x - bar;
  box({-x, 0, -deep}, {-inner, height, deep}, frame);
  box({inner, 0, -deep}, {x, height, deep}, frame);
  box({-inner, height - bar, -deep}, {inner, height, deep}, frame);
  box({-inner, 0.06, -deep}, {inner, 0.06 + bar, deep}, frame);
  box({-inner, 0.06 + bar, -0.02}, {inner, height - bar, 0.02}, mirror);
  return mesh;
}
constexpr std::uint64_t mirror_triangles = 5 * 12;

struct Ball {
  double x, z, radius;
  StillLifeMaterial material;
};
// On the board, from the left.
constexpr Ball balls[] = {
    {-3.05, 0.75, 0.46, red_lacquer},  {-0.62, 1.35, 0.62, crystal}, {0.42, 2.05, 0.30, amber},
    {2.95, 1.15, 0.40, green_lacquer}, {-2.35, 1.95, 0.17, pearl},   {-0.30, 2.50, 0.16, sapphire},
    {1.42, 2.25, 0.18, ruby},          {-1.28, 2.62, 0.13, emerald}, {2.12, 2.05, 0.14, crystal},
    {-3.42, 1.62, 0.15, amber},        {3.35, 0.35, 0.16, pearl}};

// A blown ball: what lies between its two spheres is glass. It hangs in the air, as Whitted's did.
constexpr double bubble_radius = 0.62, bubble_wall = 0.045;
constexpr dvec3 bubble_centre(2.35, 1.12, 0.10), mirror_ball(3.35, 2.05, -1.75),
    tumbler_foot(1.05, gap, 0.45);
constexpr double mirror_ball_radius = 0.80, pedestal = mirror_ball.y - mirror_ball_radius - gap;

Scene make(const Parameters& parameters) {
  Scene scene;
  scene.name = "still_life";
  scene.materials = make_materials();
  Mesh pedestal_stone;
  pedestal_stone.name = "pedestal";
  add_box(pedestal_stone, {mirror_ball.x - 0.5, 0, mirror_ball.z - 0.5},
          {mirror_ball.x + 0.5, pedestal, mirror_ball.z + 0.5}, stone, 24);
  Mesh boxes;
  boxes.name = "softboxes";
  for (const Softbox& s : softboxes)
    add_quad(boxes, s.centre - s.across - s.up, s.centre + s.across - s.up, s.centre + s.across + s.up,
             s.centre - s.across + s.up, s.material);
  scene.meshes = {board(),
                  sweep_of_paper(),
                  std::move(pedestal_stone),
                  teapot(parameters.whole("quads"), {-1.35, gap, -1.15}, 0.62, 198),
                  standing_mirror({-3.7, gap, -2.7}, 2.5, 3.0, 42),
                  tumbler(tumbler_foot),
                  water_in_tumbler(tumbler_foot),
                  straw(tumbler_foot),
                  brilliant(0.44, {-1.75, gap, 1.75}, 20),
                  std::move(boxes)};
  for (const Ball& ball : balls)
    scene.spheres.push_back(
        {vec3(dvec3(ball.x, ball.radius + gap, ball.z)), float(ball.radius), ball.material});
  scene.spheres.push_back({vec3(mirror_ball), float(mirror_ball_radius), silver});
  scene.spheres.push_back({vec3(bubble_centre), float(bubble_radius), window_glass});
  scene.spheres.push_back({vec3(bubble_centre), float(bubble_radius - bubble_wall), air});
  scene.planes.push_back({{0, 1, 0}, -0.08f, ground});
  add_lights(scene);
  scene.camera = {{0.45f, 3.35f, 9.5f}, {0.0f, 0.98f, 0}, {0, 1, 0}, 28.5f};
  scene.views = {{"table", scene.camera},
                 {"tumbler", {{1.3f, 1.75f, 4.6f}, {1.12f, 1.0f, 0.3f}, {0, 1, 0}, 30}},
                 {"gem", {{-2.1f, 1.35f, 4.6f}, {-1.35f, 0.42f, 1.6f}, {0, 1, 0}, 30}},
                 {"mirror", {{1.1f, 2.9f, 2.5f}, {-2.5f, 1.45f, -2.3f}, {0, 1, 0}, 36}}};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  const auto quads = static_cast<std::uint64_t>(parameters.whole("quads"));
  const std::uint64_t teapot = 64 * quads * quads - 8 * quads,
                      pedestal_and_softboxes = 12 + 2 * std::size(softboxes);
  const std::uint64_t triangles = board_triangles + backdrop_triangles + pedestal_and_softboxes + teapot +
                                  mirror_triangles + tumbler_triangles + water_triangles + straw_triangles +
                                  gem_triangles;
  return {triangles, triangles, std::size(balls) + 3 + 1, 0};
}

}  // namespace

std::vector<MadeScene> still_life_scenes() {
  return {{"still_life",
           "glass, water, silver and a mirror on a chequered board, after Whitted's picture",
           {{"quads", "on a side of the teapot's patches", 3, 2, 20}},
           make,
           size}};
}

}  // namespace trilha
