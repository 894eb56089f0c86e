// A loggia on a terrace that goes to the horizon: every kind of map that a material may have, in few enough
// triangles to ask every one of them.

#include <array>
#include <cmath>

#include "common/math/random.h"
#include "common/math/turn.h"
#include "common/scene/made.h"
#include "common/scene/made/build.h"
#include "common/scene/made/hall_textures.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

// Metres; y is up, and one looks along −z.

enum LoggiaMaterial : std::uint32_t {
  floor_inlay,
  terrace,
  tiles,
  plaster,
  limestone,
  ceiling,
  wood,
  fretwork,
  curtain,
  leaf,
  terracotta,
  mirror,
  orange,
  lamp_glass,
  material_count
};

constexpr double half_width = 2.5, height = 4.6, dado = 1.4;
constexpr double bay = 3.75, first_column = 5, last_column = first_column - 6 * bay;
constexpr int bays = 6;
constexpr double spring = 2.6;  // of the arches
constexpr double wall_back = 8, wall_end = -20, horizon = 420;

double fraction(double x) { return x - std::floor(x); }
double clamped(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }
double smooth(double low, double high, double x) {
  const double t = clamped((x - low) / (high - low));
  return t * t * (3 - 2 * t);
}
std::uint8_t in_a_byte(double x) { return static_cast<std::uint8_t>(std::floor(clamped(x) * 255 + 0.5)); }

/// size × size texels at(u, v), row by row from the top.
template <class At>
std::vector<u8vec4> texels_of(int size, const At& at) {
  std::vector<u8vec4> texels;
  texels.reserve(std::size_t(size) * std::size_t(size));
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) texels.push_back(at((x + 0.5) / size, 1 - (y + 0.5) / size));
  return texels;
}

/// Of a curtain: how much of the light threads hold back, between them, in round eyes and in bands.
u8vec4 lace(double u, double v) {
  const double x = fraction(12 * u) - 0.5, y = fraction(24 * v) - 0.5;
  const double eye = smooth(0.26, 0.34, std::sqrt(x * x + y * y));
  const double band = 1 - smooth(0.10, 0.12, std::abs(fraction(3 * v) - 0.5));
  const std::uint8_t opacity = in_a_byte(0.25 + 0.55 * eye + 0.2 * band);
  return {opacity, opacity, opacity, 255};
}

/// A leaf from its stalk at v = 0 to its tip at v = 1, there where alpha is 255.
u8vec4 leaf_texel(double u, double v) {
  const double x = std::abs(2 * u - 1), width = 3.1 * v * (1 - v) * (1.3 - 0.6 * v);
  const double rib = 1 - smooth(0.02, 0.06, x);
  const double side = fraction(7 * (v - 0.35 * x));
  const double vein = 0.5 * (1 - smooth(0.04, 0.12, side < 0.5 ? side : 1 - side));
  const double light = rib > vein ? rib : vein, shade = 0.85 + 0.15 * v;
  return {in_a_byte((0.20 + 0.30 * light) * shade), in_a_byte((0.40 + 0.25 * light) * shade),
          in_a_byte((0.13 + 0.12 * light) * shade), static_cast<std::uint8_t>(x < width ? 255 : 0)};
}

/// Grooves and zigzags of a potter's comb.
u8vec4 combed(double u, double v) {
  const double zigzag = std::abs(2 * fraction(4 * u) - 1);
  const double t = fraction(v < 0.5 ? 8 * v : 6 * v + 0.7 * zigzag);
  const std::uint8_t height = in_a_byte(4 * t * (1 - t));
  return {height, height, height, 255};
}

class Loggia {
 public:
  explicit Loggia(const Parameters& p)
      : texels_(p.whole("textures")), with_textures_(texels_ > 0 && p.textures()) {}

  Scene make() {
    scene_.name = "loggia";
    make_materials();
    make_floor();
    make_wall();
    make_arcade();
    make_screens();
    make_tree();
    make_avenue();
    make_lights();
    scene_.camera = {{-0.75f, 1.55f, 7.4f}, {0.55f, 1.7f, -6}, {0, 1, 0}, 46};
    scene_.views = {{"loggia", scene_.camera},
                    {"horizon", {{1.2f, 1.1f, -14}, {1.6f, 1.0f, -80}, {0, 1, 0}, 35}},
                    {"mirror", {{1.3f, 1.6f, 1.6f}, {-2.4f, 1.75f, -1.9f}, {0, 1, 0}, 50}},
                    {"tree", {{-0.35f, 1.35f, 5.0f}, {1.5f, 1.15f, 2.5f}, {0, 1, 0}, 42}}};
    finish(scene_, {0, 1, 0}, true);
    return std::move(scene_);
  }

 private:
  void make_materials();
  void make_floor();
  void make_wall();
  void make_arcade();
  void make_screens();
  void make_tree();
  void make_avenue();
  void make_lights();

  /// A texture, unless none are wanted.
  template <class Make>
  Map map(const std::string& name, TextureUse use, const Make& make, std::int8_t channel = 0) {
    if (!with_textures_) {
      if (texels_ > 0) ++scene_.images_not_read;
      return {};
    }
    scene_.textures.push_back(make_texture(name, texels_, texels_, make(), use));
    return {static_cast<std::int32_t>(scene_.textures.size() - 1), channel};
  }

  /// The diffuse map of that material, or the mean of it.
  void clad(LoggiaMaterial which, HallTexture with) {
    Material& material = scene_.materials[which];
    material.name = facts(with).name;
    material.roughness = 0.9f;
    material.diffuse_map =
        map(material.name, TextureUse::colour, [&] { return hall_texels(with, texels_).colours; });
    material.diffuse = material.diffuse_map ? vec3(1) : hall_mean_colour(with);
  }
  void normal_map(LoggiaMaterial which, HallTexture with) {
    scene_.materials[which].normal_map = map(std::string(facts(with).name) + " normals", TextureUse::data,
                                             [&] { return hall_texels(with, texels_).normals; });
  }
  void polish(LoggiaMaterial which, float specular, float shininess, float reflection) {
    Material& material = scene_.materials[which];
    material.specular = vec3(specular);
    material.shininess = shininess;
    material.reflection = vec3(reflection);
    material.roughness = 0.2f;
  }

  void add(MeshBuilder& builder) { scene_.meshes.push_back(builder.take()); }

  int texels_;
  bool with_textures_;
  Scene scene_;
};

constexpr std::uint64_t texture_count = 16;

void Loggia::make_materials() {
  scene_.materials.resize(material_count);
  clad(floor_inlay, HallTexture::nave_floor);
  normal_map(floor_inlay, HallTexture::nave_floor);
  polish(floor_inlay, 0.5f, 90, 0.10f);
  // Stones are polished, joints are not: what stands higher shines.
  scene_.materials[floor_inlay].specular_map = map("nave floor gloss", TextureUse::colour, [&] {
    return hall_heights(HallTexture::nave_floor, texels_).texels;
  });
  clad(terrace, HallTexture::aisle_floor);
  clad(tiles, HallTexture::azulejo);
  normal_map(tiles, HallTexture::azulejo);
  polish(tiles, 0.45f, 120, 0.05f);
  clad(plaster, HallTexture::plaster);
  scene_.materials[plaster].bump_map = map("plaster heights", TextureUse::data, [&] {
    HallHeights heights = hall_heights(HallTexture::plaster, texels_);
    scene_.materials[plaster].bump_scale = 3 * heights.range;
    return std::move(heights.texels);
  });
  clad(limestone, HallTexture::limestone);
  clad(ceiling, HallTexture::starry_vault);
  clad(wood, HallTexture::wood);
  clad(fretwork, HallTexture::grille);
  Material& screen = scene_.materials[fretwork];
  if (screen.diffuse_map) {
    screen.opacity_map = screen.diffuse_map;
    screen.opacity_map.channel = 3;
    screen.alpha_cutoff = 0.5f;
  }
  clad(curtain, HallTexture::cloth);
  scene_.materials[curtain].opacity_map = map(
      "lace", TextureUse::data, [&] { return texels_of(texels_, lace); }, 0);

  Material& green = scene_.materials[leaf];
  green = coloured("leaf", {0.05f, 0.16f, 0.03f});
  green.diffuse_map = map("leaf", TextureUse::colour, [&] { return texels_of(texels_, leaf_texel); });
  if (green.diffuse_map) {
    green.diffuse = vec3(1);
    green.opacity_map = green.diffuse_map;
    green.opacity_map.channel = 3;
    green.alpha_cutoff = 0.5f;
  }
  polish(leaf, 0.12f, 30, 0);
  Material& pot = scene_.materials[terracotta];
  pot = coloured("terracotta", {0.55f, 0.22f, 0.11f});
  pot.bump_map = map("comb", TextureUse::data, [&] { return texels_of(texels_, combed); });
  pot.bump_scale = 0.008f;
  polish(terracotta, 0.10f, 20, 0);
  scene_.materials[mirror] = coloured("mirror", vec3(0.01f));
  polish(mirror, 0, 0, 0.9f);
  scene_.materials[mirror].roughness = 0;
  scene_.materials[orange] = coloured("orange", {0.85f, 0.30f, 0.03f});
  polish(orange, 0.25f, 40, 0);
  scene_.materials[lamp_glass] = coloured("lamp", vec3(0.3f));
  scene_.materials[lamp_glass].emission = {3.2f, 2.3f, 1.3f};
}

void Loggia::make_floor() {
  MeshBuilder ground("floor");
  const dvec3 away(0, 0, -(wall_back + horizon));
  ground.material(floor_inlay)
      .quad({-half_width, 0, wall_back}, {2 * half_width, 0, 0}, away,
            facts(HallTexture::nave_floor).period.x);
  const double period = facts(HallTexture::aisle_floor).period.x, wide = horizon - half_width;
  ground.material(terrace).quad({half_width, 0, wall_back}, {wide, 0, 0}, away, period);
  ground.quad({-horizon, 0, wall_back}, {wide, 0, 0}, away, period);
  add(ground);
}

/// The wall on the left with its tiles and its mirror, and the ceiling on beams.
void Loggia::make_wall() {
  const double length = wall_back - wall_end;
  const dvec3 along(0, 0, -length), foot(-half_width, 0, wall_back);
  MeshBuilder wall("wall");
  wall.material(tiles).quad(foot, along, {0, dado, 0}, facts(HallTexture::azulejo).period.x);
  wall.material(plaster).quad(foot + dvec3(0, dado, 0), along, {0, height - dado, 0},
                              facts(HallTexture::plaster).period.x, {0, dado});
  wall.material(limestone).box({-half_width, dado - 0.03, wall_end},
                               {-half_width + 0.06, dado + 0.07, wall_back}, 1.25, 1);
  wall.box({-half_width, 0, wall_end}, {-half_width + 0.04, 0.14, wall_back}, 1.25, 1 | 4);
  wall.box({-half_width - 0.4, 0, wall_end - 0.5}, {-half_width + 0.1, height, wall_end}, 1.25, 4);
  wall.material(ceiling).quad({-half_width, height, wall_end}, {2 * half_width, 0, 0}, {0, 0, length},
                              facts(HallTexture::starry_vault).period.x);
  for (int i = 0; i <= bays; ++i) {
    const double z = first_column - i * bay;
    wall.material(wood).box({-half_width, height - 0.28, z - 0.11}, {half_width, height - 0.001, z + 0.11}, 1,
                            8);
  }
  add(wall);

  // A pier glass, leaning nowhere, in a frame as deep as it stands out.
  constexpr double from = -0.4, to = -3.2, low = 0.35, high = 3.35, bar = 0.12;
  constexpr double glass = -half_width + 0.09, front = -half_width + 0.14;
  MeshBuilder pier("mirror");
  pier.material(mirror).quad({glass, low + bar, from - bar}, {0, 0, to - from + 2 * bar},
                             {0, high - low - 2 * bar, 0}, 1);
  pier.material(wood);
  pier.box({-half_width, low, to}, {front, low + bar, from}, 1, 1);
  pier.box({-half_width, high - bar, to}, {front, high, from}, 1, 1);
  pier.box({-half_width, low + bar, to}, {front, high - bar, to + bar}, 1, 1 | 4 | 8);
  pier.box({-half_width, low + bar, from - bar}, {front, high - bar, from}, 1, 1 | 4 | 8);
  add(pier);
}

void Loggia::make_arcade() {
  MeshBuilder columns("columns");
  columns.material(limestone);
  const double quarter = std::sqrt(2.0) - 1;
  Profile shaft({0.27, 0.12});
  shaft.arc({0.27, 0.24}, 1, 3).line({0.2, 0.27}).line({0.17, 2.16});
  shaft.arc({0.27, 2.44}, -quarter, 2);
  for (int i = 0; i <= bays; ++i) {
    const dvec3 foot(half_width, 0, first_column - i * bay);
    columns.box(foot - dvec3(0.33, 0, 0.33), foot + dvec3(0.33, 0.12, 0.33), 1.25, 4);
    columns.lathe(shaft, 12, 1.25, 0.2, foot);
    columns.box(foot + dvec3(-0.29, 2.44, -0.29), foot + dvec3(0.29, spring, 0.29), 1.25);
  }
  add(columns);

  MeshBuilder one("arches");
  const Opening opening = arched_opening(0, spring, spring, Arch(bay / 2 - 0.25, bay / 2 - 0.1), 6);
  one.material(limestone).wall({-bay / 2, spring}, {bay / 2, height}, 0.46, 1.25, opening, false, false);
  const Mesh arch = one.take();
  Mesh arches;
  arches.name = "arches";
  for (int i = 0; i < bays; ++i) {
    const double z = first_column - (i + 0.5) * bay;
    const auto first = static_cast<std::uint32_t>(arches.positions.size());
    for (const vec3& p : arch.positions)  // its front looks in
      arches.positions.push_back(dvec3(half_width - double(p.z), double(p.y), z + double(p.x)));
    for (const vec3& n : arch.normals) arches.normals.push_back({-n.z, n.y, n.x});
    for (const vec2& uv : arch.texture_coordinates) arches.texture_coordinates.push_back(uv);
    for (const uvec3& t : arch.triangles) arches.triangles.push_back(t + first);
  }
  arches.materials.assign(arches.triangles.size(), limestone);
  scene_.meshes.push_back(std::move(arches));
}

/// Fretwork between some columns, a curtain between others.
void Loggia::make_screens() {
  MeshBuilder screens("screens");
  const double lattice = facts(HallTexture::grille).period.x;
  for (const int i : {1, 4}) {
    const double z = first_column - (i + 1) * bay + 0.25, wide = bay - 0.5;
    screens.material(fretwork).quad({half_width, 0, z}, {0, 0, wide}, {0, spring - 0.1, 0}, lattice);
    screens.material(wood).box({half_width - 0.04, spring - 0.1, z}, {half_width + 0.04, spring, z + wide},
                               1);
  }
  add(screens);

  MeshBuilder cloth("curtain");
  const double z = first_column - 4 * bay + 0.3, wide = bay - 0.6, high = 2.5;
  cloth.material(curtain).surface(
      24, 1,
      [&](double s, double t) {
        return dvec3(half_width + (0.1 - 0.04 * t) * turn(360 * 4 * s).sine, 0.1 + high * t, z + wide * s);
      },
      [](double s, double t) { return dvec2(2 * s, 0.75 * t + 0.25); });
  add(cloth);
}

/// An orange tree in a pot.
void Loggia::make_tree() {
  const dvec3 foot(1.55, 0, 2.3);
  MeshBuilder pot("pot");
  Profile outline({0.2, 0.0});
  outline.line({0.31, 0.42}, 2).arc({0.31, 0.5}, 1, 3).line({0.27, 0.5}).line({0.26, 0.42}).line({0, 0.42});
  pot.material(terracotta).lathe(outline, 16, 0.45, 0.28, foot);
  add(pot);
  const dvec3 crown = foot + dvec3(0, 1.55, 0);
  Mesh trunk = tube({foot + dvec3(0, 0.38, 0), foot + dvec3(0, 0.4, 0), foot + dvec3(0.03, 0.8, 0.02),
                     foot + dvec3(-0.01, 1.2, 0), crown, crown + dvec3(0, 0.05, 0)},
                    {0.04, 0.034, 0.03, 0.015}, 6);
  trunk.name = "trunk";
  make_area_weighted_normals(trunk);
  trunk.texture_coordinates.assign(trunk.positions.size(), vec2(0.5f));
  trunk.materials.assign(trunk.triangles.size(), wood);
  scene_.meshes.push_back(std::move(trunk));

  constexpr int leaves = 200;
  constexpr double golden = 137.50776405003785;  // degrees: 360·(2 − the golden ratio)
  MeshBuilder foliage("leaves");
  foliage.material(leaf);
  const auto chance = [](int i, std::uint64_t seed) {
    return static_cast<double>(Random::mixed(std::uint64_t(i) ^ seed << 32) >> 11) * 0x1p-53;
  };
  const auto outwards = [](double along, double degrees) {  // from −1 at the bottom to 1 at the top
    const auto [cosine, sine] = turn(degrees);
    const double radius = std::sqrt(1 - along * along);
    return dvec3(radius * cosine, along, radius * sine);
  };
  for (int i = 0; i < leaves; ++i) {
    const dvec3 out = outwards(1 - 1.8 * (i + 0.5) / leaves, golden * i);
    const dvec3 from = crown + (0.14 + 0.28 * chance(i, 1)) * out;
    const dvec3 way =
        glm::normalize(out + dvec3(2 * chance(i, 2) - 1, 0.5 - 1.5 * chance(i, 3), 2 * chance(i, 4) - 1));
    const dvec3 side = glm::normalize(glm::cross(way, dvec3(chance(i, 5) - 0.5, 1.2, chance(i, 6) - 0.5)));
    const double length = 0.20 + 0.07 * chance(i, 7), wide = 0.55 * length;
    foliage.grid(1, 1, [&](int u, int v) {
      return Vertex{from + (u - 0.5) * wide * side + double(v) * length * way, glm::cross(side, way),
                    dvec2(u, v)};
    });
  }
  add(foliage);
  for (int i = 0; i < 8; ++i)
    scene_.spheres.push_back(
        {vec3(crown + 0.43 * outwards(0.55 - 1.1 * i / 7, 101.0 * i + 20)), 0.062f, orange});
}

/// Cypresses far out: two sheets each, of which the leaf's outline is cut.
void Loggia::make_avenue() {
  MeshBuilder trees("cypresses");
  trees.material(leaf);
  for (const double z : {-34.0, -48.0, -66.0, -90.0, -124.0, -170.0, -230.0})
    for (const double x : {-6.5, 6.5, 26.0}) {
      const double wide = 1.1, high = x > 20 ? 9 : 7.5;
      trees.quad({x - wide, -0.1, z}, {2 * wide, 0, 0}, {0, high, 0}, 1);
      trees.quad({x, -0.1, z + wide}, {0, 0, -2 * wide}, {0, high, 0}, 1);
    }
  Mesh mesh = trees.take();
  for (std::size_t i = 0; i < mesh.texture_coordinates.size(); ++i)  // the leaf once, not by the metre
    mesh.texture_coordinates[i] = {i % 2, i / 2 % 2};
  scene_.meshes.push_back(std::move(mesh));
}

void Loggia::make_lights() {
  Light sun;
  sun.name = "sun";
  sun.kind = Light::Kind::directional;
  sun.direction = glm::normalize(vec3(-0.80f, -0.66f, -0.33f));
  sun.intensity = {1.75f, 1.52f, 1.15f};
  scene_.lights.push_back(sun);
  constexpr float lamp_y = 3.95f, lamp_z = -4.3f;
  scene_.spheres.push_back({{0, lamp_y, lamp_z}, 0.1f, lamp_glass});
  scene_.lights.push_back(point_light("lamp", {0, lamp_y - 0.55f, lamp_z}, {2.4f, 1.7f, 1.0f}));
  Light wash;
  wash.name = "wash on the wall";
  wash.kind = Light::Kind::spot;
  wash.position = {-0.9f, 4.2f, -8.5f};
  wash.direction = glm::normalize(vec3(-0.75f, -1, 0));
  wash.intensity = {5.5f, 4.3f, 2.9f};
  wash.inner_angle = 10;
  wash.outer_angle = 36;
  scene_.lights.push_back(wash);
  scene_.ambient = {0.24f, 0.27f, 0.33f};
  scene_.environment.colour = {0.40f, 0.58f, 0.86f};
}

Scene make(const Parameters& parameters) { return Loggia(parameters).make(); }

/// At least what there will be.
MadeSize size(const Parameters& parameters) {
  MadeSize size{3000, 3000, 8 + 1, 0};
  if (!parameters.textures()) return size;
  const auto side = static_cast<std::uint64_t>(parameters.whole("textures"));
  size.texels = texture_count * side * side;
  return size;
}

}  // namespace

std::vector<MadeScene> loggia_scenes() {
  return {{"loggia",
           "an arcade on a terrace that goes to the horizon, with maps of every kind",
           {{"textures", "texels along a texture's side; 0: no textures", 512, 0, 2048, true}},
           make,
           size}};
}

}  // namespace trilha
