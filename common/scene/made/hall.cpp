// A hypostyle hall: four rows of columns, a high nave with a clerestory over them, vaults throughout. It has
// what makes ray tracing hard: floors of two triangles the length of the hall beside chain links of
// millimetres, rails, cables and beams that no box fits well, masks, and the same column many times.

#include <algorithm>
#include <cmath>

#include "common/math/turn.h"
#include "common/scene/made.h"
#include "common/scene/made/build.h"
#include "common/scene/made/hall_textures.h"

namespace trilha {
namespace {

// Metres. The hall lies along x, its floor is y = 0; the middle of the hall is the origin.
constexpr double bay = 5;                                // from column to column
constexpr double nave = 4, row = 9, wall_axis = 14;      // where columns stand: |z|
constexpr double nave_wall = 0.7, outer_wall = 0.8;      // thickness
constexpr double nave_face = nave - nave_wall / 2;       // of the wall above the columns
constexpr double outer_face = wall_axis - 0.05;          // inner faces of the walls around
constexpr double spring = 5.2;                           // of all low arches: the tops of the columns
constexpr double arcade_half = 1.88, arcade_rise = 2.2;  // openings between nave columns
constexpr double aisle_rise = 2.55;                      // of the aisles' vaults
constexpr double walkway = 8.3;                          // floor of the gallery
constexpr double nave_spring = 9.0, nave_rise = 4.3;     // of the nave's vault
constexpr double nave_vault = nave_face + 0.02;          // half its span: its edge lies inside the wall
constexpr double wall_top = 13.6, gable_top = 16.6;
constexpr double apse_radius = 3.5, apse_spring = 6.0, apse_rise = 3.6;
constexpr double dais = 0.9;  // height
constexpr int steps = 6;

enum HallMaterial : std::uint32_t {
  // those with textures have the texture's number
  iron = hall_texture_count,
  brass,
  glow,
  material_count
};

constexpr std::uint32_t of(HallTexture texture) { return static_cast<std::uint32_t>(texture); }

class Hall {
 public:
  explicit Hall(const Parameters& p)
      : detail_(p["detail"]),
        bays_(p.whole("bays")),
        half_(bay * bays_ / 2),
        texels_(p.whole("textures")),
        textures_(p.textures()),
        root_(turned(0, p["tilt"]) * turned(1, p["angle"])) {}

  Scene make() {
    scene_.name = "hall";
    make_materials();
    make_floors();
    make_columns();
    make_nave();
    make_aisles();
    make_ends();
    make_dais();
    make_gallery();
    make_furniture();
    make_outside();
    make_lights();
    make_views();
    finish(scene_, vec3(root_ * dvec3(0, 1, 0)), true);
    return std::move(scene_);
  }

 private:
  /// How many pieces something is cut into. The divisor makes the hall of detail 4 as large as Sponza.
  int pieces(double usual, int least = 1) const {
    return std::max(least, static_cast<int>(std::floor(usual * detail_ / 4.95 + 0.5)));
  }
  /// For what goes around and has to be as symmetrical as the square that stands on it.
  int pieces_around(double usual, double span = 360) const { return int(span / 90) * pieces(usual / 4, 2); }

  static double period(HallTexture texture) { return double(facts(texture).period.x); }

  // Meshes and their places.
  std::uint32_t add(MeshBuilder& builder) {
    scene_.meshes.push_back(builder.take());
    return static_cast<std::uint32_t>(scene_.meshes.size() - 1);
  }
  void place(std::uint32_t mesh, const dvec3& at = dvec3(0), double degrees = 0, int material = -1) {
    scene_.instances.push_back(
        {mesh, material, linear(root_) * (translation(at) * linear(turned(1, degrees)))});
  }
  /// Once on the south side, as it is, and once turned about the middle of the hall.
  void place_on_both_sides(std::uint32_t mesh, const dvec3& at) {
    place(mesh, at);
    place(mesh, {-at.x, at.y, -at.z}, 180);
  }

  double column_x(int i) const { return -half_ + bay * i; }
  double bay_x(int i) const { return column_x(i) + bay / 2; }

  void make_materials();
  void make_floors();
  void make_columns();
  void make_nave();
  void make_aisles();
  void make_ends();
  void make_dais();
  void make_gallery();
  void make_furniture();
  void make_outside();
  void make_lights();
  void make_views();

  void leaf(MeshBuilder& builder, double degrees, const dvec2 (&spine)[4], double half_width, double thick,
            int columns, int rows) const;
  void chain(MeshBuilder& builder, const dvec3& from, const dvec3& to) const;
  Profile rib(double half_width, double depth) const;

  double detail_;
  int bays_;
  double half_;  // of the length, between the axes of the outermost columns
  int texels_;
  bool textures_;
  glm::dmat3 root_;
  Scene scene_;
  std::vector<dvec3> lamps_;
};

void Hall::make_materials() {
  scene_.materials.resize(material_count);
  for (int i = 0; i < hall_texture_count; ++i) {
    const auto which = static_cast<HallTexture>(i);
    const HallTextureFacts& about = facts(which);
    Material& material = scene_.materials[std::size_t(i)];
    material.name = about.name;
    material.roughness = 0.9f;
    if (texels_ == 0 || !textures_) {
      material.diffuse = hall_mean_colour(which);
      if (texels_ > 0) scene_.images_not_read += about.has_normals ? 2 : 1;
      continue;
    }
    HallTexels texels = hall_texels(which, texels_);
    const auto texture = [&](const std::string& name, std::vector<u8vec4>& of_it, TextureUse use) {
      scene_.textures.push_back(make_texture(name, texels_, texels_, std::move(of_it), use));
      return Map{static_cast<std::int32_t>(scene_.textures.size() - 1)};
    };
    material.diffuse = vec3(1);
    material.diffuse_map = texture(about.name, texels.colours, TextureUse::colour);
    if (about.has_normals)
      material.normal_map = texture(std::string(about.name) + " normals", texels.normals, TextureUse::data);
  }
  const auto polished = [&](HallTexture which, float roughness, float specular, float shininess) {
    Material& material = scene_.materials[of(which)];
    material.roughness = roughness;
    material.specular = vec3(specular);
    material.shininess = shininess;
  };
  polished(HallTexture::nave_floor, 0.22f, 0.12f, 80);
  polished(HallTexture::aisle_floor, 0.4f, 0.06f, 30);
  polished(HallTexture::red_marble, 0.3f, 0.1f, 50);
  polished(HallTexture::white_marble, 0.3f, 0.1f, 50);
  polished(HallTexture::azulejo, 0.15f, 0.15f, 120);
  polished(HallTexture::mosaic, 0.35f, 0.25f, 40);
  scene_.materials[of(HallTexture::mosaic)].metallic = 0.8f;
  Material& screen = scene_.materials[of(HallTexture::grille)];
  if (texels_ > 0) {
    screen.opacity_map = screen.diffuse_map;
    screen.opacity_map.channel = 3;
    screen.alpha_cutoff = 0.5f;
  }

  Material& metal = scene_.materials[iron];
  metal.name = "iron";
  metal.diffuse = {0.10f, 0.095f, 0.09f};
  metal.specular = vec3(0.2f);
  metal.shininess = 30;
  metal.roughness = 0.5f;
  metal.metallic = 0.6f;
  Material& gold = scene_.materials[brass];
  gold.name = "brass";
  gold.diffuse = {0.58f, 0.40f, 0.16f};
  gold.specular = {0.5f, 0.38f, 0.18f};
  gold.shininess = 60;
  gold.roughness = 0.28f;
  gold.metallic = 1;
  Material& flame = scene_.materials[glow];
  flame.name = "lamp glow";
  flame.diffuse = {0.8f, 0.75f, 0.65f};
  flame.emission = {30, 19, 9};
}

// Floors lie in bands the length of the hall, two triangles each.
void Hall::make_floors() {
  const double from = -half_ - 0.9, to = half_ + 0.75;
  MeshBuilder floor("floor");
  const auto band = [&](HallTexture what, double z0, double z1) {
    floor.material(of(what)).quad({from, 0, z1}, {to - from, 0, 0}, {0, 0, z0 - z1}, period(what),
                                  {from, -z1});
  };
  band(HallTexture::nave_floor, -2.5, 2.5);
  for (const double side : {-1.0, 1.0}) {
    const auto on_side = [&](HallTexture what, double inner, double outer) {
      side < 0 ? band(what, -outer, -inner) : band(what, inner, outer);
    };
    on_side(HallTexture::red_marble, 2.5, 2.75);
    on_side(HallTexture::flagstone, 2.75, 5.25);
    on_side(HallTexture::aisle_floor, 5.25, 7.75);
    on_side(HallTexture::flagstone, 7.75, 10.25);
    on_side(HallTexture::aisle_floor, 10.25, 12.75);
    on_side(HallTexture::flagstone, 12.75, wall_axis);
  }
  place(add(floor));
}

Profile Hall::rib(double half_width, double depth) const {
  // A roll between two hollows, from right to left: the outside is on the right of the way.
  const int n = pieces(3);
  const double w = half_width, roll = 0.55 * w;
  Profile profile({w, -1.6 * w});  // webs fall away from their groin: the back lies well behind
  profile.line({w, 0.3 * depth});
  profile.arc({roll, depth - 0.7 * roll}, -0.35, n);
  profile.arc({-roll, depth - 0.7 * roll}, 0.9, pieces(6));
  profile.arc({-w, 0.3 * depth}, -0.35, n);
  profile.line({-w, -1.6 * w});
  return profile;
}

/// A leaf whose spine is a Bézier curve in (radius, height), closed: front and back meet at its edges.
void Hall::leaf(MeshBuilder& builder, double degrees, const dvec2 (&spine)[4], double half_width,
                double thick, int columns, int rows) const {
  const auto [cosine, sine] = turn(degrees);
  const dvec3 out(sine, 0, cosine), right(cosine, 0, -sine);
  const auto face = [&](double across, double t, double side) {
    const double s = 2 * across - 1, u = 1 - t, t4 = t * t * t * t, u8 = u * u * u * u * u * u * u * u;
    const dvec2 point =
        u * u * u * spine[0] + 3 * u * u * t * spine[1] + 3 * u * t * t * spine[2] + t * t * t * spine[3];
    const dvec2 way =
        u * u * (spine[1] - spine[0]) + 2 * u * t * (spine[2] - spine[1]) + t * t * (spine[3] - spine[2]);
    const dvec2 normal = dvec2(way.y, -way.x) / glm::length(way);
    const double lobe = 3.5 * t - std::floor(3.5 * t), edge = 4 * lobe * (1 - lobe);
    const double width = half_width * (1 - t4) * (0.74 + 0.26 * edge) * (0.9 + 0.8 * t * (1 - t));
    const double body = 1 - s * s, rib = body * body * body * body;
    const double bulge = side > 0
                             ? thick * (0.75 * body + 0.7 * rib * rib + 0.5 * (edge - 0.5) * body * s * s)
                             : -thick * 0.5 * body;
    // The blade is arched, its edges lie on the bell; it is as thin as a line where it begins and ends.
    const dvec2 at = point + (bulge * (1 - u8) - 0.22 * half_width * s * s) * (1 - t4) * normal;
    const dvec3 flat = at.x * out + s * width * right;
    return flat * (at.x / glm::length(flat)) + dvec3(0, at.y, 0);
  };
  builder.sheet(columns, rows, std::max(1, columns / 2), {2 * half_width / 1.25, 4 * half_width / 1.25},
                face);
}

void Hall::make_columns() {
  const double stone = period(HallTexture::limestone);
  const auto base = [&](MeshBuilder& builder, double r, double plinth, double height, double around,
                        double span) {
    const double h = height - 0.4 * height;  // of the mouldings
    const double y = 0.4 * height;
    Profile block({plinth, 0});
    block.line({plinth, y - 0.03}).line({plinth - 0.03, y}).line({0, y});
    builder.prism(block, 4, stone);
    Profile attic({r + 0.13, y});
    attic.arc({r + 0.10, y + 0.36 * h}, 0.9, pieces(5, 2))
        .arc({r + 0.055, y + 0.62 * h}, -0.5, pieces(4))
        .arc({r + 0.045, y + 0.86 * h}, 0.9, pieces(4, 2))
        .arc({r - 0.012, y + h}, -0.4, pieces(2));
    builder.lathe(attic, pieces_around(around, span), stone, r, dvec3(0), span);
  };
  const auto shaft = [&](MeshBuilder& builder, double r0, double y0, double r1, double y1, double around,
                         double span) {
    Profile profile({r0, y0});
    profile.arc({r1, y1}, 0.009, pieces(8, 2));  // entasis: an arc of a very large circle
    builder.lathe(profile, pieces_around(around, span), stone, r0, dvec3(0), span);
  };
  const auto abacus = [&](MeshBuilder& builder, double half, double y0, double y1) {
    const double h = y1 - y0;
    Profile profile({0.6 * half, y0});
    profile.line({half - 0.08, y0})
        .line({half - 0.08, y0 + 0.22 * h})
        .arc({half - 0.01, y0 + 0.6 * h}, -0.35, pieces(3))
        .line({half, y0 + 0.6 * h})
        .line({half, y1})
        .line({0, y1});
    builder.prism(profile, 4, stone);
  };

  // The nave's: two rings of leaves around the bell, and four that carry the abacus's corners.
  MeshBuilder nave_base("nave column base"), nave_shaft("nave column shaft"),
      nave_capital("nave column capital");
  base(nave_base, 0.5, 0.7, 0.74, 28, 360);
  shaft(nave_shaft, 0.5, 0.70, 0.44, 4.08, 36, 360);
  Profile bell({0.43, 4.02});
  bell.line({0.47, 4.04}).arc({0.47, 4.12}, 0.95, pieces(4, 2)).line({0.43, 4.12});
  bell.line({0.42, 4.18}).arc({0.57, 4.93}, -0.25, pieces(4)).arc({0.57, 5.01}, 0.9, pieces(3, 1));
  nave_capital.lathe(bell, pieces_around(28, 360), stone, 0.44);
  for (int i = 0; i < 8; ++i) {
    leaf(nave_capital, 45 * i, {{0.44, 4.10}, {0.48, 4.36}, {0.47, 4.72}, {0.68, 4.47}}, 0.15, 0.05,
         pieces(6, 2), pieces(10, 3));
    leaf(nave_capital, 45 * i + 22.5, {{0.42, 4.13}, {0.46, 4.50}, {0.48, 5.02}, {0.76, 4.74}}, 0.14, 0.05,
         pieces(6, 2), pieces(10, 3));
  }
  for (int i = 0; i < 4; ++i)
    leaf(nave_capital, 90 * i + 45, {{0.44, 4.40}, {0.50, 4.80}, {0.74, 5.16}, {0.92, 4.80}}, 0.13, 0.05,
         pieces(6, 2), pieces(10, 3));
  abacus(nave_capital, 0.68, 5.0, spring);
  const std::uint32_t nave_parts[] = {add(nave_base), add(nave_shaft), add(nave_capital)};

  // The aisles': plainer and slimmer, of marble. Those at the walls stand half in them and are half columns.
  struct Parts {
    std::uint32_t base, shaft, capital;
  };
  const auto slim = [&](const std::string& name, bool whole) {
    const double span = whole ? 360 : 180;
    MeshBuilder foot(name + " base"), body(name + " shaft"), head(name + " capital");
    base(foot, 0.33, 0.5, 0.55, 20, span);
    body.material(of(HallTexture::red_marble));
    shaft(body, 0.33, 0.52, 0.28, 4.35, 28, span);
    Profile basket({0.27, 4.30});
    basket.line({0.305, 4.32}).arc({0.305, 4.38}, 0.95, pieces(4, 2)).line({0.275, 4.38});
    basket.arc({0.42, 4.98}, -0.25, pieces(4)).arc({0.42, 5.03}, 0.9, pieces(2));
    head.lathe(basket, pieces_around(20, span), stone, 0.3, dvec3(0), span);
    for (int i = -3; i <= 4; ++i)
      if (whole || std::abs(2 * i - 1) < 5)
        leaf(head, 45 * i - 22.5, {{0.27, 4.36}, {0.32, 4.58}, {0.31, 5.00}, {0.50, 4.70}}, 0.11, 0.035,
             pieces(3, 2), pieces(7, 3));
    for (int i = -1; i <= 2; ++i)
      if (whole || i == 0 || i == 1)
        leaf(head, 90 * i - 45, {{0.28, 4.55}, {0.33, 4.88}, {0.50, 5.18}, {0.66, 4.84}}, 0.095, 0.035,
             pieces(3, 2), pieces(7, 3));
    abacus(head, 0.5, 5.02, spring);
    return Parts{add(foot), add(body), add(head)};
  };
  const Parts free = slim("aisle column", true), engaged = slim("wall column", false);

  const auto stand = [&](const Parts& parts, double x, double z, double degrees, int of_shaft) {
    place(parts.base, {x, 0, z}, degrees);
    place(parts.shaft, {x, 0, z}, degrees, of_shaft);
    place(parts.capital, {x, 0, z}, degrees);
  };
  const int pale = int(of(HallTexture::white_marble));
  for (int i = 0; i <= bays_; ++i)
    for (const double side : {-1.0, 1.0}) {
      // Turned by quarters, so that neighbours do not show the same veins.
      const double degrees = 90 * ((2 * i + i / 2 + (side > 0)) % 4);
      stand({nave_parts[0], nave_parts[1], nave_parts[2]}, column_x(i), side * nave, degrees, -1);
      stand(free, column_x(i), side * row, degrees, i % 2 == 0 ? pale : -1);
      stand(engaged, column_x(i), side * wall_axis, side < 0 ? 0 : 180, i % 2 == 1 ? pale : -1);
    }
}

void Hall::make_nave() {
  const int n = pieces(8, 2);
  const double wall_stone = period(HallTexture::ashlar), stone = period(HallTexture::limestone);

  // The wall over the columns, one bay: the arcade, and the clerestory above.
  const Arch arcade(arcade_half, arcade_rise);
  MeshBuilder wall("nave wall");
  wall.material(of(HallTexture::ashlar));
  wall.wall({-bay / 2, spring}, {bay / 2, walkway}, nave_wall, wall_stone,
            arched_opening(0, spring, spring, arcade, n), false, true);
  const Arch light(1.4, 1.6);
  const double sill = 9.45, light_spring = 10.75;
  wall.wall({-bay / 2, walkway}, {bay / 2, wall_top}, nave_wall, wall_stone,
            arched_opening(0, sill, light_spring, light, n), true, false);
  // Stones of two colours around the arcade's arch, over its soffit and both faces.
  wall.material(of(HallTexture::voussoir));
  const double out = nave_wall / 2 + 0.03;
  Profile ring_of_stones({nave_wall / 2 - 0.02, -0.42});
  ring_of_stones.line({out, -0.42}).line({out, 0.0}).arc({out - 0.06, 0.06}, 0.41, pieces(2));
  ring_of_stones.line({-out + 0.06, 0.06}).arc({-out, 0.0}, 0.41, pieces(2)).line({-out, -0.42});
  ring_of_stones.line({-nave_wall / 2 + 0.02, -0.42});
  const double half_arch = arcade.lengths(n).back();
  const double pair = half_arch / std::floor(half_arch / 0.7 + 0.5);  // whole stones, a red one at the apex
  for (const Path& path : arcade.paths({0, spring, 0}, {1, 0, 0}, n))
    wall.sweep(path, ring_of_stones, {pair, 0.7}, 0.25);

  // The window: a frame, two lights under a ring, saddle bars.
  wall.material(of(HallTexture::limestone));
  const Profile bar =
      Profile({0.09, -0.075}).line({0.09, 0.02}).arc({-0.09, 0.02}, 0.8, pieces(4, 2)).line({-0.09, -0.075});
  const auto frame = [&](const Arch& arch, double middle, double from, double above, const Profile& profile) {
    for (const Path& path : arch.paths({middle, above, 0}, {1, 0, 0}, n))
      wall.sweep(path, profile, {stone, stone});
    wall.sweep(straight({middle - arch.half, from, 0}, {middle - arch.half, above, 0}, {1, 0, 0}), profile,
               {stone, stone});
    wall.sweep(straight({middle + arch.half, above, 0}, {middle + arch.half, from, 0}, {-1, 0, 0}), profile,
               {stone, stone});
  };
  frame(light, 0, sill, light_spring, bar);
  const Profile mullion = Profile::circle(0.075, pieces(6, 4)), bead = Profile::circle(0.06, pieces(6, 4));
  wall.sweep(straight({0, sill, 0}, {0, light_spring + 0.12, 0}, {0, 0, 1}), mullion, {stone, stone});
  const Arch small(0.685, 0.8);
  for (const double side : {-1.0, 1.0}) {
    for (const Path& path : small.paths({side * small.half, light_spring, 0}, {1, 0, 0}, n))
      wall.sweep(path, bead, {stone, stone});
    const double jamb = 2 * side * small.half;
    wall.sweep(straight({jamb, sill, 0}, {jamb, light_spring, 0}, {-side, 0, 0}), bead, {stone, stone});
  }
  wall.sweep(ring({0, light_spring + 0.93, 0}, 0.38, {1, 0, 0}, {0, 1, 0}, pieces_around(16)), bead,
             {stone, stone});
  wall.material(iron);
  for (int i = 0; i < 3; ++i) {
    const double y = sill + 0.35 + 0.42 * i;
    wall.sweep(straight({-light.half, y, 0}, {light.half, y, 0}, {0, 1, 0}),
               Profile::circle(0.012, pieces(4, 3)), {1, 1});
  }
  const std::uint32_t nave_wall_mesh = add(wall);

  // Shafts on the wall carry the vault.
  MeshBuilder shafts("wall shafts");
  const auto thin = [&](double x, double z, double r) {
    const dvec3 foot(x, 0, z);
    Profile profile({r + 0.05, spring});
    profile.line({r + 0.05, spring + 0.06}).arc({r, spring + 0.16}, -0.5, pieces(3));
    profile.line({r, nave_spring - 0.3});
    profile.arc({r, nave_spring - 0.26}, 0.9, pieces(2));
    profile.arc({r + 0.09, nave_spring - 0.08}, -0.3, pieces(4));
    profile.line({r + 0.09, nave_spring});
    shafts.lathe(profile, pieces(12, 6), stone, r, foot);
  };
  thin(0, 0.09, 0.13);
  thin(-0.21, 0.04, 0.08);
  thin(0.21, 0.04, 0.08);
  shafts.box({-0.36, nave_spring - 0.03, -0.1}, {0.36, nave_spring + 0.08, 0.36}, stone);
  const std::uint32_t shaft_mesh = add(shafts);

  for (int i = 0; i < bays_; ++i) place_on_both_sides(nave_wall_mesh, {bay_x(i), 0, -nave});
  for (int i = 0; i <= bays_; ++i) place_on_both_sides(shaft_mesh, {column_x(i), 0, -nave_face});

  // The vault, one bay: webs, ribs under the groins and along the walls, a boss.
  const Arch over_x(bay / 2, nave_rise, nave_vault), over_z(nave_vault, nave_rise);
  const double groin = std::sqrt(bay * bay / 4 + nave_vault * nave_vault);
  MeshBuilder vault("nave vault");
  vault.material(of(HallTexture::starry_vault));
  for (int quarter = 0; quarter < 4; ++quarter)
    vault.web(quarter % 2 == 0 ? over_x : over_z, quarter % 2 == 0 ? nave_vault : bay / 2, n,
              period(HallTexture::starry_vault), quarter);
  vault.material(of(HallTexture::limestone));
  for (const double side : {-1.0, 1.0})
    for (const Path& path :
         Arch(groin, nave_rise, nave_vault).paths(dvec3(0), dvec3(bay / 2, 0, side * nave_vault) / groin, n))
      vault.sweep(path, rib(0.12, 0.22), {stone, stone});
  for (const double side : {-1.0, 1.0})
    for (const Path& path : over_x.paths({0, 0, side * (nave_face - 0.03)}, {1, 0, 0}, n))
      vault.sweep(path, rib(0.09, 0.13), {stone, stone});
  vault.material(brass);
  Profile boss({0, nave_rise - 0.42});
  boss.arc({0.17, nave_rise - 0.36}, 0.3, pieces(3)).arc({0.27, nave_rise - 0.22}, 0.5, pieces(3));
  boss.arc({0.20, nave_rise}, 0.3, pieces(3));
  vault.lathe(boss, pieces(20, 6), 1, 0.27);
  const std::uint32_t vault_mesh = add(vault);
  for (int i = 0; i < bays_; ++i) place(vault_mesh, {bay_x(i), nave_spring, 0});

  MeshBuilder transverse("nave transverse arch");
  for (const Path& path : over_z.paths(dvec3(0), {0, 0, 1}, 2 * n))
    transverse.sweep(path, rib(0.2, 0.32), {stone, stone});
  const std::uint32_t transverse_mesh = add(transverse);
  for (int i = 0; i <= bays_; ++i) place(transverse_mesh, {column_x(i), nave_spring, 0});

  // Tie rods: thin, across the whole nave.
  MeshBuilder rod("tie rod");
  rod.material(iron).sweep(straight({0, nave_spring + 0.25, -nave}, {0, nave_spring + 0.25, nave}, {0, 1, 0}),
                           Profile::circle(0.018, pieces(6, 3)), {1, 1});
  const std::uint32_t rod_mesh = add(rod);
  for (int i = 1; i < bays_; ++i) place(rod_mesh, {column_x(i), 0, 0});
}

void Hall::make_aisles() {
  const int n = pieces(8, 2);
  const double stone = period(HallTexture::limestone), half = bay / 2;
  const Arch arch(half, aisle_rise);
  const double groin = half * std::sqrt(2.0);

  MeshBuilder vault("aisle vault");
  vault.material(of(HallTexture::plaster));
  for (int quarter = 0; quarter < 4; ++quarter)
    vault.web(arch, half, n, period(HallTexture::plaster), quarter);
  vault.material(of(HallTexture::limestone));
  for (const double side : {-1.0, 1.0})
    for (const Path& path :
         Arch(groin, aisle_rise, half).paths(dvec3(0), dvec3(half, 0, side * half) / groin, n))
      vault.sweep(path, rib(0.10, 0.17), {stone, stone});
  Profile boss({0, aisle_rise - 0.30});
  boss.arc({0.12, aisle_rise - 0.26}, 0.3, pieces(2)).arc({0.19, aisle_rise - 0.16}, 0.5, pieces(2));
  boss.arc({0.14, aisle_rise}, 0.3, pieces(2));
  vault.lathe(boss, pieces(14, 6), stone, 0.19);
  const std::uint32_t vault_mesh = add(vault);

  MeshBuilder striped("aisle arch");
  striped.material(of(HallTexture::voussoir));
  Profile block({0.26, -0.05});
  block.line({0.26, 0.27}).arc({0.20, 0.33}, 0.41, pieces(2)).line({-0.20, 0.33});
  block.arc({-0.26, 0.27}, 0.41, pieces(2)).line({-0.26, -0.05});
  const double half_arch = arch.lengths(n).back();
  const double pair = half_arch / std::floor(half_arch / 0.7 + 0.5);
  for (const Path& path : arch.paths(dvec3(0), {1, 0, 0}, n)) striped.sweep(path, block, {pair, 0.7}, 0.25);
  const std::uint32_t arch_mesh = add(striped);

  MeshBuilder wall_rib("aisle wall rib");
  for (const Path& path : arch.paths(dvec3(0), {1, 0, 0}, n))
    wall_rib.sweep(path, rib(0.10, 0.15), {stone, stone});
  const std::uint32_t wall_rib_mesh = add(wall_rib);

  for (int i = 0; i < bays_; ++i)
    for (const double side : {-1.0, 1.0}) {
      place(vault_mesh, {bay_x(i), spring, side * 6.5});
      place(vault_mesh, {bay_x(i), spring, side * 11.5});
      place(arch_mesh, {bay_x(i), spring, side * row});
      place(wall_rib_mesh, {bay_x(i), spring, side * (nave + nave_wall / 2 + 0.03)});
      place(wall_rib_mesh, {bay_x(i), spring, side * (outer_face - 0.03)});
    }
  for (int i = 0; i <= bays_; ++i)
    for (const double side : {-1.0, 1.0}) {
      place(arch_mesh, {column_x(i), spring, side * 6.5}, 90);
      place(arch_mesh, {column_x(i), spring, side * 11.5}, 90);
    }

  // The outer wall, one bay: a window with a screen of pierced wood.
  const Arch light(1.2, 1.4);
  const double sill = 2.0, light_spring = 4.5;
  MeshBuilder wall("outer wall");
  const double wall_stone = period(HallTexture::ashlar);
  wall.material(of(HallTexture::ashlar));
  const Opening opening = arched_opening(0, sill, light_spring, light, n);
  wall.wall({-half, -0.15}, {half, 8.1}, outer_wall, wall_stone, opening, true, false);
  wall.material(of(HallTexture::limestone));
  const double face = outer_wall / 2;
  Profile hood({face - 0.02, -0.16});
  hood.line({face + 0.05, -0.16}).arc({face + 0.05, 0.0}, 0.6, pieces(4, 2)).line({face - 0.02, 0.0});
  for (const Path& path : light.paths({0, light_spring, 0}, {1, 0, 0}, n))
    wall.sweep(path, hood, {stone, stone});
  wall.sweep(straight({-light.half, sill, 0}, {-light.half, light_spring, 0}, {1, 0, 0}), hood,
             {stone, stone});
  wall.sweep(straight({light.half, light_spring, 0}, {light.half, sill, 0}, {-1, 0, 0}), hood,
             {stone, stone});
  wall.box({-light.half - 0.3, sill - 0.16, face - 0.1}, {light.half + 0.3, sill, face + 0.12}, stone);
  const std::uint32_t wall_mesh = add(wall);

  MeshBuilder screen("window screen");
  screen.material(of(HallTexture::grille));
  const double lattice = period(HallTexture::grille);
  screen.grid(int(opening.size()) - 1, 1, [&](int i, int j) {
    const OpeningColumn& c = opening[std::size_t(i)];
    const double y = j == 0 ? c.low : c.high;
    return Vertex{{c.x, y, 0}, {0, 0, 1}, dvec2(c.x, y) / lattice};
  });
  const std::uint32_t screen_mesh = add(screen);
  for (int i = 0; i < bays_; ++i) {
    place_on_both_sides(wall_mesh, {bay_x(i), 0, -outer_face - outer_wall / 2});
    place_on_both_sides(screen_mesh, {bay_x(i), 0, -outer_face - outer_wall / 2 - 0.05});
  }

  // Tiles along the foot of the wall, and a rail over them, each the length of the hall.
  MeshBuilder dado("tiles");
  dado.material(of(HallTexture::azulejo));
  const double end = half_ - 0.05;
  dado.quad({-end - 0.1, 0, 0.02}, {2 * end + 0.2, 0, 0}, {0, 1.4, 0}, period(HallTexture::azulejo));
  dado.material(of(HallTexture::limestone));
  Profile rail({0.05, 1.48});
  rail.line({-0.05, 1.48}).arc({-0.05, 1.40}, 0.8, pieces(3, 2)).line({0.05, 1.40});
  dado.sweep(straight({-end - 0.1, 0, 0}, {end + 0.1, 0, 0}, {0, 1, 0}), rail, {stone, stone});
  place_on_both_sides(add(dado), {0, 0, -outer_face});

  // Beams along the rows of columns and across the aisles.
  MeshBuilder beam("long beam"), joist("cross beam");
  beam.material(of(HallTexture::wood));
  beam.box({-half_ - 0.3, spring + 0.04, -0.12}, {half_ + 0.3, spring + 0.28, 0.12},
           period(HallTexture::wood), 3);
  joist.material(of(HallTexture::wood));
  joist.box({-4.9, spring + 0.06, -0.09}, {4.9, spring + 0.26, 0.09}, period(HallTexture::wood), 3);
  const std::uint32_t beam_mesh = add(beam), joist_mesh = add(joist);
  for (const double z : {-row, -nave, nave, row}) place(beam_mesh, {0, 0, z});
  for (int i = 1; i < bays_; ++i)
    for (const double side : {-1.0, 1.0}) place(joist_mesh, {column_x(i), 0, side * 9.1}, 90);
}

void Hall::make_ends() {
  const int n = pieces(10, 3);
  const double wall_stone = period(HallTexture::ashlar), stone = period(HallTexture::limestone);
  const double half_width = 4.75, face = outer_wall / 2;
  const double apse_x = half_ + 0.7;  // where its centre lies

  // Beside the nave, alike at both ends.
  MeshBuilder side("end wall of the aisles");
  side.material(of(HallTexture::ashlar));
  side.wall({half_width, -0.15}, {outer_face + outer_wall, 9.3}, outer_wall, wall_stone, {}, true, false,
            true);
  side.wall({-outer_face - outer_wall, -0.15}, {-half_width, 9.3}, outer_wall, wall_stone, {}, true, false,
            true);
  const std::uint32_t side_mesh = add(side);
  const double wall_x = half_ - 0.05 + outer_wall / 2;
  place(side_mesh, {-wall_x, 0, 0}, 90);
  place(side_mesh, {wall_x, 0, 0}, -90);

  const auto archivolt = [&](MeshBuilder& wall, const Arch& arch, double above, double width) {
    const double out = face + 0.04;
    Profile profile({face - 0.02, -width});
    profile.line({out, -width}).line({out, 0.0}).arc({out - 0.06, 0.06}, 0.41, pieces(2));
    profile.line({-out + 0.06, 0.06})
        .arc({-out, 0.0}, 0.41, pieces(2))
        .line({-out, -width})
        .line({-face + 0.02, -width});
    const double length = arch.lengths(n).back(), pair = length / std::floor(length / 0.7 + 0.5);
    wall.material(of(HallTexture::voussoir));
    for (const Path& path : arch.paths({0, above, 0}, {1, 0, 0}, n))
      wall.sweep(path, profile, {pair, 0.7}, 0.25);
    // The stones stand on imposts.
    wall.material(of(HallTexture::limestone));
    for (const double x : {-arch.half, arch.half}) {
      const double a = x < 0 ? x - width - 0.1 : x - 0.14, b = x < 0 ? x + 0.14 : x + width + 0.1;
      wall.box({a, above - 0.2, -out - 0.06}, {b, above, out + 0.06}, stone);
      wall.box({a + 0.04, above - 0.34, -out - 0.02}, {b - 0.04, above - 0.18, out + 0.02}, stone);
    }
  };

  // Where one comes in: a door, and a rose above it.
  MeshBuilder entrance("entrance wall");
  entrance.material(of(HallTexture::ashlar));
  const Arch door(1.6, 2.0);
  entrance.wall({-half_width, -0.15}, {half_width, 6.4}, outer_wall, wall_stone,
                arched_opening(0, -0.15, 3.1, door, n), false, false, true);
  const double rose_y = 9.9, rose = 2.05;
  entrance.wall({-half_width, 6.4}, {half_width, gable_top}, outer_wall, wall_stone,
                round_opening(0, rose_y, rose, 2 * n), true, false, true);
  archivolt(entrance, door, 3.1, 0.45);
  entrance.material(of(HallTexture::limestone));
  const int around = pieces_around(40);
  Profile moulding({face - 0.02, -0.28});
  moulding.line({face + 0.06, -0.28}).arc({face + 0.06, -0.12}, 0.7, pieces(4, 2)).line({face + 0.02, -0.02});
  moulding.line({face - 0.02, -0.02});
  entrance.sweep(ring({0, rose_y, 0}, rose, {1, 0, 0}, {0, 1, 0}, around), moulding, {stone, stone});
  const Profile bar = Profile::circle(0.06, pieces(6, 3));
  const Profile thick = Profile::circle(0.085, pieces(6, 3));
  entrance.sweep(ring({0, rose_y, 0}, rose, {1, 0, 0}, {0, 1, 0}, around), thick, {stone, stone});
  entrance.sweep(ring({0, rose_y, 0}, 0.45, {1, 0, 0}, {0, 1, 0}, pieces_around(20)), thick, {stone, stone});
  for (int i = 0; i < 12; ++i) {
    const auto [c, s] = turn(30.0 * i);
    const dvec3 way(s, c, 0);
    entrance.sweep(straight(dvec3(0, rose_y, 0) + 0.45 * way, dvec3(0, rose_y, 0) + 1.42 * way, {0, 0, 1}),
                   bar, {stone, stone});
    const auto [c2, s2] = turn(30.0 * i + 15);
    entrance.sweep(
        ring(dvec3(0, rose_y, 0) + 1.62 * dvec3(s2, c2, 0), 0.36, {1, 0, 0}, {0, 1, 0}, pieces_around(16)),
        bar, {stone, stone});
  }
  place(add(entrance), {-wall_x, 0, 0}, 90);

  // Where one looks to: the arch of the apse, a round window over it.
  const double oculus_y = 12.1;
  const Arch great(3.15, 3.3);
  MeshBuilder choir("apse wall");
  choir.material(of(HallTexture::ashlar));
  choir.wall({-half_width, -0.15}, {half_width, 10.6}, outer_wall, wall_stone,
             arched_opening(0, -0.15, apse_spring, great, n), false, false, true);
  choir.wall({-half_width, 10.6}, {half_width, gable_top}, outer_wall, wall_stone,
             round_opening(0, oculus_y, 0.7, n), true, false, true);
  archivolt(choir, great, apse_spring, 0.5);
  choir.material(of(HallTexture::limestone));
  choir.sweep(ring({0, oculus_y, 0}, 0.7, {1, 0, 0}, {0, 1, 0}, around), moulding, {stone, stone});
  for (int i = 0; i < 3; ++i) {
    const auto [c, s] = turn(60.0 * i);
    choir.sweep(straight(dvec3(0, oculus_y, 0) - 0.7 * dvec3(s, c, 0),
                         dvec3(0, oculus_y, 0) + 0.7 * dvec3(s, c, 0), {0, 0, 1}),
                bar, {stone, stone});
  }
  place(add(choir), {wall_x, 0, 0}, -90);

  // The apse: five sides of ten, each with a window, and a vault of five webs.
  const auto [cosine, sine] = turn(18);
  const double apothem = apse_radius * cosine, side_half = apse_radius * sine, deep = 0.5;
  MeshBuilder apse("apse side");
  apse.material(of(HallTexture::ashlar));
  const Arch lancet(0.5, 0.8);
  apse.wall({-1.25, -0.15}, {1.25, apse_spring + 1.1}, deep, wall_stone,
            arched_opening(0, 2.5, 4.8, lancet, pieces(8, 2)), true, false);
  apse.material(of(HallTexture::white_marble));
  apse.box({-1.25, dais, 0}, {1.25, dais + 1.2, deep / 2 + 0.03}, period(HallTexture::white_marble), 4 | 16);
  apse.material(of(HallTexture::limestone));
  Profile string({0.1, 2.22});
  string.line({-0.08, 2.22}).arc({-0.08, 2.1}, 0.8, pieces(4, 2)).line({0.1, 2.1});
  apse.sweep(straight({-1.25, 0, deep / 2}, {1.25, 0, deep / 2}, {0, 1, 0}), string, {stone, stone});
  Profile hood({deep / 2 - 0.02, -0.14});
  hood.line({deep / 2 + 0.04, -0.14})
      .arc({deep / 2 + 0.04, 0.0}, 0.6, pieces(4, 2))
      .line({deep / 2 - 0.02, 0.0});
  for (const Path& path : lancet.paths({0, 4.8, 0}, {1, 0, 0}, pieces(8, 2)))
    apse.sweep(path, hood, {stone, stone});
  apse.sweep(straight({-0.5, 2.5, 0}, {-0.5, 4.8, 0}, {1, 0, 0}), hood, {stone, stone});
  apse.sweep(straight({0.5, 4.8, 0}, {0.5, 2.5, 0}, {-1, 0, 0}), hood, {stone, stone});
  apse.sweep(straight({0, 2.5, 0}, {0, 5.58, 0}, {0, 0, 1}), Profile::circle(0.04, pieces(6, 3)),
             {stone, stone});
  apse.material(of(HallTexture::mosaic));
  const Arch dome(apse_radius, apse_rise), middle(apothem, apse_rise, apse_radius);
  const int up = pieces(14, 3), across = pieces(4);
  const std::vector<double> length = middle.lengths(up);
  apse.grid(across, up, [&](int i, int j) {
    const Arch::Point p = middle.point(double(j) / up);
    const double x = side_half * (p.at.x / apothem) * (2.0 * i / across - 1);
    return Vertex{{x, apse_spring + p.at.y, deep / 2 + apothem - p.at.x},
                  {0, p.normal.y, -p.normal.x},
                  dvec2(x, length[std::size_t(j)]) / period(HallTexture::mosaic)};
  });
  const std::uint32_t apse_mesh = add(apse);
  for (int k = -2; k <= 2; ++k) {
    const double degrees = -90 + 36 * k;
    const dvec3 inwards = turned(1, degrees) * dvec3(0, 0, 1);
    place(apse_mesh, dvec3(apse_x, 0, 0) - (apothem + deep / 2) * inwards, degrees);
  }
  MeshBuilder apse_ribs("apse ribs");
  for (int k = 0; k <= 5; ++k) {
    const dvec3 corner = turned(1, 36 * k) * dvec3(0, 0, 1);
    apse_ribs.sweep(dome.paths({0, apse_spring, 0}, -corner, up)[0], rib(0.09, 0.16), {stone, stone});
    Profile profile({0.16, dais});
    profile.line({0.16, dais + 0.12})
        .arc({0.08, dais + 0.24}, -0.5, pieces(3))
        .line({0.08, apse_spring - 0.35});
    profile.arc({0.08, apse_spring - 0.3}, 0.9, pieces(3, 2)).arc({0.17, apse_spring - 0.1}, -0.3, pieces(4));
    profile.line({0.17, apse_spring + 0.03}).line({0, apse_spring + 0.03});
    apse_ribs.lathe(profile, pieces_around(16), stone, 0.08, (apse_radius - 0.05) * corner);
  }
  apse_ribs.material(brass);
  Profile boss({0, apse_spring + apse_rise - 0.38});
  boss.arc({0.2, apse_spring + apse_rise - 0.3}, 0.3, pieces(4, 2))
      .arc({0.28, apse_spring + apse_rise}, 0.4, pieces(4, 2));
  apse_ribs.lathe(boss, pieces_around(24), 1, 0.27);
  place(add(apse_ribs), {apse_x, 0, 0});
}

void Hall::make_dais() {
  const double marble = period(HallTexture::white_marble), width = 3.0;
  const double edge = half_ - 4, tread = 0.36, rise = dais / steps;
  MeshBuilder stairs("dais");
  stairs.material(of(HallTexture::white_marble));
  // Along z, from above to below; a tread ends in a round nosing.
  Profile profile({half_ + 0.7, dais});
  for (int i = 0; i < steps; ++i) {
    const double x = edge - tread * i, y = dais - rise * i;
    profile.line({x, y})
        .arc({x, y - 0.036}, 0.9, pieces(3))
        .line({x + 0.02, y - 0.036})
        .line({x + 0.02, y - rise});
  }
  stairs.sweep(straight({0, 0, -width}, {0, 0, width}, {0, 1, 0}), profile, {marble, marble});
  const double foot = edge - tread * (steps - 1) - 0.25;
  for (const double side : {-1.0, 1.0}) {
    const double a = side * (width - 0.01), b = side * (width + 0.22);
    stairs.box({foot, 0, std::min(a, b)}, {half_, dais + 0.12, std::max(a, b)}, marble, 4);
    stairs.box({foot - 0.05, dais + 0.1, std::min(a, b) - 0.04}, {half_, dais + 0.2, std::max(a, b) + 0.04},
               marble);
  }
  // In the arch and in the apse.
  stairs.quad({half_ - 0.1, dais - 0.001, width + 0.4}, {0.81, 0, 0}, {0, 0, -2 * width - 0.8}, marble);
  std::vector<dvec3> corners;
  for (int k = 0; k <= 5; ++k)
    corners.push_back(dvec3(half_ + 0.7, dais, 0) +
                      (apse_radius + 0.2) * (turned(1, 36 * k) * dvec3(0, 0, 1)));
  stairs.polygon(corners, {1, 0, 0}, {0, 0, -1}, marble);
  place(add(stairs));

  // A great bowl on a foot, and two stands of lamps.
  MeshBuilder bowl("bowl");
  bowl.material(of(HallTexture::white_marble));
  Profile step({0.95, 0});
  step.line({0.95, 0.12}).line({0.75, 0.12}).line({0.75, 0.24}).line({0.3, 0.24});
  bowl.prism(step, 8, marble);
  bowl.material(of(HallTexture::red_marble));
  Profile pillar({0.42, 0.24});
  pillar.line({0.42, 0.30})
      .arc({0.24, 0.5}, -0.5, pieces(6, 2))
      .line({0.22, 0.75})
      .arc({0.22, 0.83}, 0.9, pieces(4, 2));
  pillar.arc({0.3, 0.95}, -0.4, pieces(4, 2));
  bowl.lathe(pillar, pieces_around(40), 1.25, 0.3);
  bowl.material(brass);
  Profile vessel({0.26, 0.94});
  vessel.arc({0.98, 1.42}, 0.38, pieces(14, 4))
      .arc({0.94, 1.46}, 0.9, pieces(4, 2))
      .arc({0, 1.04}, -0.38, pieces(14, 4));
  bowl.lathe(vessel, pieces_around(56), 1, 0.8);
  place(add(bowl), {half_ + 0.9, dais, 0});

  MeshBuilder stand("lamp stand");
  stand.material(brass);
  Profile stem({0.28, 0});
  stem.arc({0.22, 0.08}, 0.4, pieces(4, 2)).arc({0.045, 0.3}, -0.5, pieces(6, 2)).line({0.035, 0.8});
  stem.arc({0.035, 0.92}, 0.9, pieces(6, 2))
      .line({0.03, 1.7})
      .arc({0.03, 1.8}, 0.9, pieces(6, 2))
      .line({0.03, 1.95});
  stem.arc({0.2, 2.12}, -0.5, pieces(6, 2)).line({0.2, 2.14}).line({0, 2.14});
  stand.lathe(stem, pieces_around(24), 1, 0.1);
  stand.material(glow);
  Profile flame({0.0, 2.13});
  flame.arc({0.07, 2.22}, 0.5, pieces(4, 2)).arc({0, 2.42}, 0.25, pieces(6, 2));
  stand.lathe(flame, pieces_around(12), 1, 0.07);
  const std::uint32_t stand_mesh = add(stand);
  place(stand_mesh, {half_ - 2.4, dais, -2.3});
  place(stand_mesh, {half_ - 2.4, dais, 2.3});
}

void Hall::make_gallery() {
  const double stone = period(HallTexture::limestone), end = half_ - 0.05, edge = 0.9;
  // The walk: one piece the length of the hall.
  MeshBuilder walk("gallery walk");
  Profile profile({0.1, 0});
  profile.line({-edge, 0})
      .arc({-edge, -0.11}, 0.6, pieces(4, 2))
      .line({-edge + 0.06, -0.11})
      .line({-edge + 0.06, -0.15});
  profile.arc({-edge + 0.18, -0.25}, -0.4, pieces(4, 2)).line({0.1, -0.25});
  walk.sweep(straight({-end - 0.1, walkway, 0}, {end + 0.1, walkway, 0}, {0, 1, 0}), profile, {stone, stone});
  place_on_both_sides(add(walk), {0, 0, -nave_face});

  // A bracket under it.
  MeshBuilder bracket("bracket");
  const double top = walkway - 0.24;
  Profile side({-0.72, top + 0.02});
  side.line({-0.72, top - 0.12})
      .arc({-0.56, top - 0.22}, 0.35, pieces(4, 2))
      .arc({-0.14, top - 0.46}, -0.4, pieces(6, 2));
  side.arc({-0.05, top - 0.6}, 0.4, pieces(4, 2)).line({0.05, top - 0.6});
  const double half_width = 0.11;
  bracket.sweep(straight({-half_width, 0, 0}, {half_width, 0, 0}, {0, 1, 0}), side, {stone, stone});
  for (const double end_side : {-1.0, 1.0}) {
    std::vector<dvec3> corners{{end_side * half_width, top + 0.02, -0.05}};
    std::vector<dvec2> outline{{-0.72, top + 0.02}};
    for (const auto& piece : side.pieces())
      for (std::size_t i = 1; i < piece.size(); ++i) outline.push_back(piece[i].at);
    if (end_side < 0) std::reverse(outline.begin(), outline.end());
    for (const dvec2& p : outline) corners.push_back({end_side * half_width, p.y, -p.x});
    bracket.polygon(corners, {0, 0, -end_side}, {0, 1, 0}, stone);
  }
  const std::uint32_t bracket_mesh = add(bracket);
  for (int i = 0; i < bays_; ++i)
    for (const double x : {-5 / 3.0, 0.0, 5 / 3.0})
      place_on_both_sides(bracket_mesh, {bay_x(i) + x, 0, -nave_face});

  // The railing: two rails the length of the hall, and in each bay bars and posts.
  const double z = edge - 0.08, height = 1.0;
  MeshBuilder rails("hand rail");
  rails.material(iron);
  for (const auto& [y, r] : {std::pair{height, 0.024}, {height - 0.12, 0.010}, {0.1, 0.012}})
    rails.sweep(straight({-end - 0.1, walkway + y, z}, {end + 0.1, walkway + y, z}, {0, 1, 0}),
                Profile::circle(r, pieces(7, 4)), {1, 1});
  place_on_both_sides(add(rails), {0, 0, -nave_face});
  MeshBuilder bars("railing");
  bars.material(iron);
  const Profile thin = Profile::circle(0.008, pieces(4, 3));
  for (int i = 0; i < 24; ++i) {
    const double x = -bay / 2 + bay * (i + 0.5) / 24;
    if (i % 12 == 6) continue;
    bars.sweep(straight({x, walkway + 0.1, z}, {x, walkway + height - 0.12, z}, {0, 0, 1}), thin, {1, 1});
  }
  for (int i = 0; i < 2; ++i) {
    const double x = -bay / 2 + bay * (i * 12 + 6.5) / 24;
    Profile post({0.05, walkway});
    post.line({0.05, walkway + 0.05}).line({0.02, walkway + 0.07}).line({0.02, walkway + height + 0.02});
    post.arc({0, walkway + height + 0.12}, 0.8, pieces(4, 2));
    bars.lathe(post, pieces(7, 4), 1, 0.05, {x, 0, z});
  }
  const std::uint32_t bars_mesh = add(bars);
  for (int i = 0; i < bays_; ++i) place_on_both_sides(bars_mesh, {bay_x(i), 0, -nave_face});
}

/// Links of a chain, each turned against the one before.
void Hall::chain(MeshBuilder& builder, const dvec3& from, const dvec3& to) const {
  const double length = glm::length(to - from), pitch = 0.11;
  const int links = static_cast<int>(std::floor(length / pitch + 0.5));
  const dvec3 way = (to - from) / length;
  const dvec3 side = glm::normalize(glm::cross(way, dvec3(0, 1, 0))), other = glm::cross(way, side);
  const double wire = 0.006, round = 0.018;
  const int around = 4 * pieces(1.5);
  const Profile profile = Profile::circle(wire, pieces(4, 3));
  for (int i = 0; i < links; ++i) {
    const dvec3 middle = from + (to - from) * ((i + 0.5) / links);
    Path path = ring(middle, round, way, i % 2 == 0 ? side : other, around);
    for (PathNode& node : path) {
      const double along = glm::dot(node.position - middle, way);
      if (std::abs(along) > 1e-9) node.position += (along > 0 ? 0.042 : -0.042) * way;
    }
    builder.sweep(path, profile, {1, 1});
  }
}

void Hall::make_furniture() {
  // Chandeliers in the nave, each on one cable.
  const double height = 4.5, radius = 1.15, hub = 1.7;
  MeshBuilder lamp("chandelier");
  lamp.material(brass);
  Profile band({0.022, -0.05});
  band.line({0.022, 0.05}).arc({-0.022, 0.05}, 0.9, pieces(3, 2)).line({-0.022, -0.05});
  band.arc({0.022, -0.05}, 0.9, pieces(3, 2));
  const auto hoop = [&](double r, double y) {
    // across the band is up here: its frame is turned by a quarter
    Path path = ring({0, y, 0}, r, {0, 0, 1}, {1, 0, 0}, pieces_around(48));
    for (PathNode& node : path) {
      node.up = dvec3(0, 1, 0);
      node.across = glm::cross(node.up, node.tangent);
    }
    lamp.sweep(path, band, {1, 1});
  };
  hoop(radius, 0);
  hoop(0.16, hub);
  const int cups = 12;
  for (int i = 0; i < cups; ++i) {
    const auto [c, s] = turn(360.0 * i / cups);
    const dvec3 at(radius * s, 0.04, radius * c);
    lamp.material(brass);
    Profile cup({0.0, 0.0});
    cup.arc({0.055, 0.045}, 0.4, pieces(4)).line({0.05, 0.05}).line({0, 0.05});
    lamp.lathe(cup, pieces(8, 5), 1, 0.05, at);
    lamp.material(glow);
    Profile flame({0.0, 0.045});
    flame.arc({0.03, 0.09}, 0.5, pieces(3)).arc({0, 0.2}, 0.25, pieces(4));
    lamp.lathe(flame, pieces(7, 4), 1, 0.03, at);
  }
  lamp.material(iron);
  for (int i = 0; i < 3; ++i) {
    const auto [c, s] = turn(120.0 * i + 15);
    chain(lamp, {radius * s, 0.05, radius * c}, {0.16 * s, hub, 0.16 * c});
    lamp.sweep(straight({0.16 * s, hub, 0.16 * c}, {0, hub + 0.35, 0}, {s, 1, c}),
               Profile::circle(0.008, pieces(4, 3)), {1, 1});
  }
  const auto hook = [&](MeshBuilder& builder, double y, double r) {  // where a cable ends
    Profile ball({0, y - r});
    ball.arc({0, y + r}, 1, pieces(6, 3));
    builder.lathe(ball, pieces(8, 4), 1, r);
  };
  hook(lamp, hub + 0.33, 0.035);
  const std::uint32_t lamp_mesh = add(lamp);
  const auto cable = [&](const char* name, double from, double to, double r) {
    MeshBuilder builder(name);
    builder.material(iron).sweep(straight({0, from, 0}, {0, to, 0}, {0, 0, 1}),
                                 Profile::circle(r, pieces(6, 3)), {1, 1});
    return add(builder);
  };
  const std::uint32_t nave_cable =
      cable("chandelier cable", height + hub + 0.3, nave_spring + nave_rise - 0.35, 0.010);
  for (int i = 1; i < bays_ - 1; i += 2) {
    place(lamp_mesh, {bay_x(i), height, 0}, 10 * i);
    place(nave_cable, {bay_x(i), 0, 0});
    lamps_.push_back({bay_x(i), height + 0.1, 0});
  }

  // A lamp hangs in each arch of the arcade and in every other bay of the aisles.
  MeshBuilder glass("hanging lamp");
  glass.material(brass);
  Profile body({0.0, -0.42});
  body.arc({0.05, -0.38}, 0.4, pieces(3)).line({0.05, -0.34}).arc({0.13, -0.2}, 0.35, pieces(4));
  body.arc({0.08, -0.06}, 0.35, pieces(4)).arc({0.14, 0.1}, -0.3, pieces(4)).line({0.13, 0.1});
  body.arc({0.07, -0.06}, 0.3, pieces(3));
  glass.lathe(body, pieces(16, 6), 1, 0.13);
  glass.material(glow);
  Profile light({0.07, -0.07});
  light.arc({0, 0.14}, 0.35, pieces(4));
  glass.lathe(light, pieces(8, 5), 1, 0.06);
  glass.material(iron);
  for (int i = 0; i < 3; ++i) {
    const auto [c, s] = turn(120.0 * i);
    glass.sweep(straight({0.136 * s, 0.09, 0.136 * c}, {0, 0.75, 0}, {s, 1, c}), Profile::circle(0.004, 3),
                {1, 1});
  }
  hook(glass, 0.73, 0.022);
  const std::uint32_t glass_mesh = add(glass);
  const double arcade_lamp = 3.9, aisle_lamp = 3.5;
  const std::uint32_t short_cable = cable("arcade cable", arcade_lamp + 0.7, spring + arcade_rise, 0.006);
  const std::uint32_t long_cable = cable("aisle cable", aisle_lamp + 0.7, spring + aisle_rise - 0.25, 0.006);
  for (int i = 0; i < bays_; ++i)
    for (const double side : {-1.0, 1.0}) {
      place(glass_mesh, {bay_x(i), arcade_lamp, side * nave}, 60 * i);
      place(short_cable, {bay_x(i), 0, side * nave});
      const double z = side * (i % 2 == 0 ? 6.5 : 11.5);
      place(glass_mesh, {bay_x(i), aisle_lamp, z}, 60 * i);
      place(long_cable, {bay_x(i), 0, z});
    }

  // Banners before the piers; thin, but with a front on both sides.
  MeshBuilder banner("banner");
  banner.material(of(HallTexture::cloth));
  banner.sheet(pieces(20, 5), pieces(26, 6), pieces(20, 5), {1, 1}, [](double s, double up, double face) {
    const double t = 1 - up;
    const double fold = turn(360 * (1.6 * s + 0.15 * t)).sine, wave = turn(360 * (0.45 * t + 0.2 * s)).sine;
    const bool edge = s == 0 || s == 1 || t == 0 || t == 1;
    const double z = 0.045 * (0.25 + 0.75 * t) * fold + 0.05 * t * wave + (edge ? 0 : face * 0.003);
    return dvec3(1.1 * (s - 0.5) * (1 - 0.03 * t), -3.2 * t, z);
  });
  banner.material(brass);
  banner.sweep(straight({-0.68, 0.0, 0}, {0.68, 0.0, 0}, {0, 1, 0}), Profile::circle(0.022, pieces(8, 4)),
               {1, 1});
  for (const double x : {-0.7, 0.7}) {
    Profile ball({0, -0.045});
    ball.arc({0, 0.045}, 1, pieces(8, 4));
    banner.lathe(ball, pieces_around(12), 1, 0.045, {x, 0, 0});
  }
  banner.material(iron);
  for (const double x : {-0.5, 0.5})
    banner.sweep(straight({x, 0, 0}, {x, 0.4, 0}, {0, 0, 1}), Profile::circle(0.006, pieces(4, 3)), {1, 1});
  const std::uint32_t banner_mesh = add(banner);
  for (int i = 1; i < bays_; ++i)
    for (const double side : {-1.0, 1.0})
      if ((i + (side > 0)) % 2 == 0)
        place(banner_mesh, {column_x(i), 7.8, side * (nave_face - 0.62)}, side > 0 ? 180 : 0);

  // Screens between the columns beside the dais.
  MeshBuilder frame("screen frame"), lattice("screen");
  frame.material(of(HallTexture::wood));
  const double w = 1.95, top = 2.6, grain = period(HallTexture::wood), mesh = period(HallTexture::grille);
  frame.box({-w, 0, -0.06}, {w, 0.5, 0.06}, grain);
  frame.box({-w, top - 0.14, -0.07}, {w, top, 0.07}, grain);
  frame.box({-w - 0.05, top, -0.1}, {w + 0.05, top + 0.07, 0.1}, grain);
  const Profile post =
      Profile({0.06, -0.08}).line({0.06, 0.08}).line({-0.06, 0.08}).line({-0.06, -0.08}).line({0.06, -0.08});
  for (const double x : {-w, -w / 3, w / 3, w})
    frame.sweep(straight({x, 0, 0}, {x, top, 0}, {0, 0, 1}), post, {grain, grain});
  lattice.material(of(HallTexture::grille));
  lattice.quad({-w, 0.45, 0}, {2 * w, 0, 0}, {0, top - 0.55, 0}, mesh, {-w, 0.45});
  const std::uint32_t frame_mesh = add(frame), lattice_mesh = add(lattice);
  for (int i = std::max(bays_ - 2, 1); i < bays_; ++i)
    for (const double side : {-1.0, 1.0}) {
      place(frame_mesh, {bay_x(i), 0, side * nave}, side > 0 ? 180 : 0);
      place(lattice_mesh, {bay_x(i), 0, side * nave}, side > 0 ? 180 : 0);
    }
}

void Hall::make_outside() {
  // Ground around the hall, and roofs.
  const double x = half_ + 14, z = 26, flag = period(HallTexture::flagstone),
               tile = period(HallTexture::roof_tiles);
  MeshBuilder ground("ground");
  ground.material(of(HallTexture::flagstone));
  ground.quad({-x, -0.15, z}, {2 * x, 0, 0}, {0, 0, -2 * z}, flag, {-x, -z});
  place(add(ground));

  MeshBuilder roof("roofs");
  const double end = half_ + 0.4;
  const auto slab = [&](const dvec2& low, const dvec2& high) {  // (z, y) of its upper edges
    for (const double side : {-1.0, 1.0}) {
      const dvec3 a(-end * side, low.y, side * low.x), along(2 * end * side, 0, 0);
      const dvec3 slope(0, high.y - low.y, side * (high.x - low.x)), down(0, -0.12, 0);
      roof.material(of(HallTexture::roof_tiles)).quad(a, along, slope, tile);
      roof.material(of(HallTexture::wood)).quad(a + down + slope, along, -slope, 1);
      roof.quad(a + down, along, -down, 1);
    }
  };
  slab({outer_face + outer_wall + 0.25, 8.05}, {nave + nave_wall / 2 - 0.05, 9.25});
  slab({nave + nave_wall / 2 + 0.4, wall_top - 0.12}, {0, 16.1});
  // Over the apse.
  roof.material(of(HallTexture::roof_tiles));
  const auto [cosine, sine] = turn(18);
  const double eaves = (apse_radius * cosine + 0.4) / cosine;
  const dvec3 peak(half_ + 0.7, apse_spring + 5.3, 0);
  for (int k = 0; k < 5; ++k) {
    const dvec3 a = dvec3(peak.x, apse_spring + 1.05, 0) + eaves * (turned(1, 36 * k) * dvec3(0, 0, 1));
    const dvec3 b = dvec3(peak.x, apse_spring + 1.05, 0) + eaves * (turned(1, 36 * (k + 1)) * dvec3(0, 0, 1));
    const dvec3 u = glm::normalize(b - a), normal = glm::normalize(glm::cross(b - a, peak - a));
    roof.polygon({a, b, peak}, u, glm::cross(normal, u), tile);
  }
  place(add(roof));
}

void Hall::make_lights() {
  Light sun;
  sun.name = "sun";
  sun.kind = Light::Kind::directional;
  sun.direction = vec3(root_ * glm::normalize(dvec3(-0.75, -1.75, 1)));
  sun.intensity = {64, 56, 44};
  scene_.lights.push_back(sun);
  for (const dvec3& at : lamps_) {
    Light light;
    light.name = "chandelier";
    light.position = vec3(root_ * at);
    light.intensity = {12, 8, 4.4f};
    scene_.lights.push_back(light);
  }
  scene_.ambient = {0.20f, 0.20f, 0.21f};
  scene_.environment.colour = {4.2f, 5.0f, 6.3f};
}

void Hall::make_views() {
  const auto camera = [&](const dvec3& eye, const dvec3& target, float field_of_view) {
    return Camera{vec3(root_ * eye), vec3(root_ * target), vec3(root_ * dvec3(0, 1, 0)), field_of_view};
  };
  const double middle = bay_x(bays_ / 2);
  scene_.camera = camera({-half_ + 2.9, 1.9, -0.7}, {half_, 4.9, 0.25}, 58);
  scene_.views = {
      {"entrance", scene_.camera},
      {"gallery", camera({bay_x(0) + 0.6, walkway + 1.7, 3.0}, {bay_x(2), 6.6, -1.4}, 62)},
      {"aisle", camera({-half_ + 1.5, 1.7, -11.2}, {half_, 3.2, -7.5}, 60)},
      {"capital", camera({column_x(1) - 1.5, 3.9, -1.9}, {column_x(1) + 0.15, 4.9, -4.2}, 45)},
      {"floor", camera({middle - 4, 0.7, 1.9}, {half_, 2.6, -1.4}, 50)},
      {"dais", camera({half_ - 9.5, 2.2, 1.2}, {half_ + 2, 4.4, -0.2}, 55)},
      {"vault", camera({middle - 3, 1.6, 0.6}, {middle + 5, 12, -0.4}, 70)},
  };
}

Scene hall(const Parameters& parameters) { return Hall(parameters).make(); }

/// What is cut both ways grows with the square of the detail, what is cut one way with the detail, and a bay
/// has about as many triangles as all meshes once, the rest of the hall as one bay at most. The numbers lie
/// above the counts of details from 1 to 26, by half at most.
MadeSize hall_size(const Parameters& parameters) {
  const double detail = parameters["detail"];
  const auto once = static_cast<std::uint64_t>(1700 * detail * detail + 1500 * detail + 6000);
  MadeSize size{once, once * static_cast<std::uint64_t>(parameters.whole("bays") + 1), 0, 0};
  if (!parameters.textures()) return size;
  const auto side = static_cast<std::uint64_t>(parameters.whole("textures"));
  for (int i = 0; i < hall_texture_count; ++i)
    size.texels += (facts(static_cast<HallTexture>(i)).has_normals ? 2 : 1) * side * side;
  return size;
}

}  // namespace

// Triangles with 8 bays (Sponza has 66 445 as Dabrovic made it, 262 267 as Crytek did):
//
//     detail      1       2       3        4        6        8        12         16         26
//     triangles   67 896  92 573  168 221  261 100  588 878  998 191  2 206 721  3 872 974  10 217 064
//
// At detail 1 much is cut as coarsely as it can be, so that fewer bays make it smaller: 3 have 30 232. A bay
// more is 31 thousand triangles at detail 4.
std::vector<MadeScene> hall_scenes() {
  return {{"hall",
           "a vaulted hall of columns in the sun; detail=1: 68 thousand triangles, 4: 261 thousand, 26: 10 "
           "million",
           {{"detail", "how finely it is cut; triangles grow with its square", 4, 1, 26, false},
            {"angle", "degrees by which it is turned about the vertical", 0, -360, 360, false},
            {"tilt", "degrees by which it is then turned about the x axis", 0, -360, 360, false},
            {"bays", "how long it is, in bays of 5 m", 8, 3, 40, true},
            {"textures", "texels along a texture's side; 0: no textures", 512, 0, 2048, true}},
           hall,
           hall_size}};
}

}  // namespace trilha
