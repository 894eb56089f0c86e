// The made hall: the same bits on every machine, fronts to the air, sound at every size, and a place that its
// cameras stand free in.

#include "tests/testing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "common/math/random.h"
#include "common/math/turn.h"
#include "common/scene/flatten.h"
#include "common/scene/made.h"
#include "common/scene/made/hall_textures.h"

using namespace trilha;

namespace {

Scene hall(const std::string& parameters) {
  for (const MadeScene& made : made_scenes())
    if (std::string(made.name) == "hall") return made.make(Parameters("hall", made.parameters, parameters));
  throw std::logic_error("there is no hall");
}

Mesh whole(const Scene& scene) { return flattened(scene, {true, true, true}); }

/// FNV-1a, 64 bits.
class Hash {
 public:
  template <class T>
  void add(const std::vector<T>& list) {
    for (const T& item : list) add_bytes(&item, sizeof item);
  }
  template <class T>
  void add(const T& item) {
    add_bytes(&item, sizeof item);
  }
  std::uint64_t value() const { return value_; }

 private:
  void add_bytes(const void* from, std::size_t count) {
    const auto* bytes = static_cast<const unsigned char*>(from);
    for (std::size_t i = 0; i < count; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3ull;
  }
  std::uint64_t value_ = 0xcbf29ce484222325ull;
};

std::uint64_t hash(const Scene& scene) {
  Hash h;
  for (const Mesh& mesh : scene.meshes) {
    h.add(mesh.positions);
    h.add(mesh.triangles);
    h.add(mesh.normals);
    h.add(mesh.texture_coordinates);
    h.add(mesh.materials);
  }
  for (const Instance& instance : scene.instances) {
    h.add(instance.mesh);
    h.add(instance.material);
    h.add(instance.transform);
  }
  for (const Texture& texture : scene.textures)
    for (const TextureLevel& level : texture.levels) h.add(level.bytes);
  for (const Material& material : scene.materials) h.add(material.diffuse);
  for (const Light& light : scene.lights) {
    h.add(light.position);
    h.add(light.direction);
  }
  for (const View& view : scene.views) {
    h.add(view.camera.eye);
    h.add(view.camera.target);
    h.add(view.camera.up);
  }
  return h.value();
}

struct Triangle {
  dvec3 a, b, c;
};
Triangle corners(const Mesh& mesh, std::size_t i) {
  const uvec3& t = mesh.triangles[i];
  return {mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]};
}
dvec3 area_vector(const Triangle& t) { return 0.5 * glm::cross(t.b - t.a, t.c - t.a); }

struct Seen {
  double distance = std::numeric_limits<double>::infinity();
  std::size_t triangle = 0;
  bool front = true;
};

/// The nearest triangle on the ray, whichever way it faces; Möller & Trumbore (1997) in double. What
/// `passes` says is not there.
template <class Passes>
Seen nearest(const Mesh& mesh, const dvec3& origin, const dvec3& way, const Passes& passes) {
  Seen seen;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle t = corners(mesh, i);
    const dvec3 u = t.b - t.a, v = t.c - t.a, p = glm::cross(way, v), s = origin - t.a;
    const double determinant = glm::dot(u, p);
    if (determinant == 0) continue;
    const double first = glm::dot(s, p) / determinant;
    if (first < 0 || first > 1) continue;
    const dvec3 q = glm::cross(s, u);
    const double second = glm::dot(way, q) / determinant, distance = glm::dot(v, q) / determinant;
    if (second < 0 || first + second > 1 || distance <= 1e-9 || distance >= seen.distance || passes(i))
      continue;
    seen = {distance, i, determinant > 0};
  }
  return seen;
}

/// The distance from the point to a triangle (Ericson 2005, section 5.1.5).
double distance_to(const dvec3& p, const Triangle& t) {
  const dvec3 ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a, bp = p - t.b, cp = p - t.c;
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap), d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d1 <= 0 && d2 <= 0) return glm::length(ap);
  if (d3 >= 0 && d4 <= d3) return glm::length(bp);
  if (d6 >= 0 && d5 <= d6) return glm::length(cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return glm::length(ap - ab * (d1 / (d1 - d3)));
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return glm::length(ap - ac * (d2 / (d2 - d6)));
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return glm::length(bp - (t.c - t.b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
  const dvec3 n = glm::normalize(glm::cross(ab, ac));
  return std::abs(glm::dot(ap, n));
}

/// A direction, uniform on the sphere.
dvec3 direction(Random& random) {
  for (;;) {
    const dvec3 v(2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1,
                  2 * random.uniform_double() - 1);
    const double length = glm::length(v);
    if (length > 0.1 && length < 1) return v / length;
  }
}

bool masked(const Scene& scene, const Mesh& mesh, std::size_t triangle) {
  return scene.materials[mesh.materials[triangle]].alpha_cutoff > 0;
}

bool is_finite(const vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

}  // namespace

// Catches: a function of the C library, a fused multiply-add or the order of threads in what is made, all of
// which differ between machines; and changes of the hall that nobody meant. If a change is meant, the test
// says the new values: copy them here.
TEST_CASE("the hall has the same bits on every machine", "[hall]") {
  const std::pair<const char*, std::uint64_t> known[] = {
      {"", 0x66775c14b737f739},
      {"detail=1,bays=3,textures=0", 0xc2e12de2e4684463},
      {"detail=2.5,angle=30,tilt=12.5,bays=5,textures=33", 0x1baebca451b63dfa},
      {"detail=9,bays=4,textures=16,angle=-71", 0x0d553b5914401b13},
  };
  for (const auto& [parameters, value] : known) {
    const std::uint64_t now = hash(hall(parameters));
    INFO("\"" << parameters << "\" has 0x" << std::hex << now << ", not 0x" << value);
    CHECK(now == value);
  }
  CHECK(hash(hall("detail=1,textures=64")) == hash(hall("detail=1,textures=64")));
}

// Catches: detail that does nothing, or explodes, and a default that is no longer Sponza's size (262 267).
TEST_CASE("triangles of the hall grow with the square of its detail", "[hall]") {
  const auto count = [](const std::string& text) {
    return double(hall(text + ",textures=0").triangle_count());
  };
  const double at_1 = count("detail=1"), at_4 = count("detail=4"), at_8 = count("detail=8");
  CHECK(at_4 == Approx(262267).epsilon(0.01));
  CHECK(at_1 == Approx(66445).epsilon(0.05));
  CHECK(at_8 == Approx(4 * at_4).epsilon(0.15));
  CHECK(count("detail=24") == Approx(36 * at_4).epsilon(0.2));
  double last = 0;
  for (const char* detail : {"1", "1.5", "2", "2.5", "3", "4", "5", "6", "7.5", "9"}) {
    const double now = count(std::string("detail=") + detail);
    CHECK(now > last);
    if (last > 0) CHECK(now < 2.1 * last);
    last = now;
  }
  CHECK(count("bays=16") == Approx(2 * at_4).epsilon(0.1));
}

// Catches: numbers of vertices, materials, textures or meshes beyond their ends, NaN, normals that are not of
// length one, and a feature that the hall should have and lacks.
TEST_CASE("the hall is sound", "[hall]") {
  for (const char* text :
       {"detail=1,bays=3,textures=8", "detail=3,textures=8,angle=30", "detail=4,textures=0"}) {
    INFO(text);
    const Scene scene = hall(text);
    std::set<std::uint32_t> placed, used;
    std::set<std::string> names;
    for (const Instance& instance : scene.instances) {
      REQUIRE(instance.mesh < scene.meshes.size());
      REQUIRE(instance.material < int(scene.materials.size()));
      CHECK_FALSE(is_singular(instance.transform));
      CHECK_FALSE(mirrors(instance.transform));
      placed.insert(instance.mesh);
      if (instance.material >= 0) used.insert(std::uint32_t(instance.material));
    }
    CHECK(placed.size() == scene.meshes.size());
    for (const Mesh& mesh : scene.meshes) {
      INFO(mesh.name);
      CHECK(names.insert(mesh.name).second);
      const std::size_t n = mesh.positions.size();
      REQUIRE(mesh.normals.size() == n);
      REQUIRE(mesh.texture_coordinates.size() == n);
      REQUIRE(mesh.materials.size() == mesh.triangles.size());
      REQUIRE_FALSE(mesh.triangles.empty());
      CHECK(std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite));
      CHECK(std::all_of(mesh.normals.begin(), mesh.normals.end(),
                        [](const vec3& v) { return std::abs(glm::length(dvec3(v)) - 1) < 1e-6; }));
      CHECK(std::all_of(mesh.texture_coordinates.begin(), mesh.texture_coordinates.end(),
                        [](const vec2& uv) { return std::abs(uv.x) < 1000 && std::abs(uv.y) < 1000; }));
      CHECK(std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                        [n](const uvec3& t) { return t.x < n && t.y < n && t.z < n; }));
      for (const std::uint32_t material : mesh.materials) {
        REQUIRE(material < scene.materials.size());
        used.insert(material);
      }
    }
    CHECK(used.size() == scene.materials.size());
    std::set<std::int32_t> textures;
    for (const Material& m : scene.materials)
      for (const Map* map : {&m.diffuse_map, &m.normal_map, &m.opacity_map})
        if (*map) {
          REQUIRE(map->texture < int(scene.textures.size()));
          textures.insert(map->texture);
        }
    CHECK(textures.size() == scene.textures.size());
    const SceneFeatures& f = scene.features;
    const bool textured = std::string(text).find("textures=0") == std::string::npos;
    CHECK((f.normals && f.texture_coordinates && f.materials && f.emission && f.instances));
    CHECK((f.point_lights && f.directional_lights && f.environment));
    CHECK((f.textures == textured && f.alpha == textured && f.bumps == textured));
    for (const Material& m : scene.materials)
      for (int c = 0; c < 3; ++c) CHECK((m.diffuse[c] > 0.02f && (m.diffuse_map || m.diffuse[c] < 0.85f)));
  }
}

// Catches: a resolution at which a triangle shrinks to nothing, here or after it is put far from the origin;
// and faces whose vertex normals look the other way.
TEST_CASE("the hall has no degenerate triangles, and its normals look out of its fronts", "[hall]") {
  for (const char* text : {"detail=1,bays=3,angle=30,tilt=20", "detail=1.7,bays=40,angle=45",
                           "detail=4,bays=40,angle=30", "detail=24,bays=40,angle=33,tilt=10"}) {
    INFO(text);
    const Scene scene = hall(text + std::string(",textures=0"));
    std::vector<const Instance*> farthest(scene.meshes.size(), nullptr);
    for (const Instance& instance : scene.instances) {
      const Instance*& so_far = farthest[instance.mesh];
      if (!so_far || glm::length(instance.transform[3]) > glm::length(so_far->transform[3]))
        so_far = &instance;
    }
    for (const Instance* instance : farthest) {
      const Mesh& mesh = scene.meshes[instance->mesh];
      INFO(mesh.name);
      std::size_t degenerate = 0, degenerate_there = 0, turned_away = 0;
      for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle t = corners(mesh, i);
        const dvec3 area = area_vector(t);
        if (!(glm::length(area) > 1e-9)) ++degenerate;
        const auto there = [&](const dvec3& p) { return dvec3(vec3(apply(instance->transform, p))); };
        if (!(glm::length(area_vector({there(t.a), there(t.b), there(t.c)})) > 1e-10)) ++degenerate_there;
        double sum = 0;
        for (int k = 0; k < 3; ++k) sum += glm::dot(area, dvec3(mesh.normals[mesh.triangles[i][k]]));
        if (!(sum > 0)) ++turned_away;
      }
      CHECK(degenerate == 0);
      CHECK(degenerate_there == 0);
      CHECK(turned_away == 0);
    }
  }
}

// Catches: two triangles in one place, of which a ray meets either: a sheet whose sides touch, a part put
// twice.
TEST_CASE("no triangle of the hall stands twice", "[hall]") {
  const Scene scene = hall("detail=2,bays=3,textures=0");
  const Mesh mesh = whole(scene);
  std::set<std::array<std::array<float, 3>, 3>> places;
  for (const uvec3& t : mesh.triangles) {
    std::array<std::array<float, 3>, 3> place;
    for (int k = 0; k < 3; ++k) {
      const vec3& p = mesh.positions[t[k]];
      place[std::size_t(k)] = {p.x, p.y, p.z};
    }
    std::sort(place.begin(), place.end());
    if (places.insert(place).second) continue;
    INFO(place[0][0] << ", " << place[0][1] << ", " << place[0][2]);
    CHECK(false);
  }
}

// Catches: walls that are missing, or turned inside out: whoever stands in the air sees only fronts. Screens,
// which are seen from both sides, may be seen from behind.
TEST_CASE("from where its cameras stand only fronts of the hall are seen", "[hall]") {
  for (const char* text : {"detail=1,bays=3", "detail=2,bays=4,angle=30,tilt=10"}) {
    const Scene scene = hall(text + std::string(",textures=8"));
    const Mesh mesh = whole(scene);
    Random random(7);
    std::size_t sky = 0, rays = 0;
    std::vector<dvec3> eyes;
    for (const View& view : scene.views) eyes.push_back(view.camera.eye);
    for (const dvec3& eye : eyes)
      for (int i = 0; i < 40; ++i) {
        const dvec3 way = direction(random);
        const Seen seen = nearest(mesh, eye, way, [](std::size_t) { return false; });
        ++rays;
        if (std::isinf(seen.distance)) {
          ++sky;
          continue;
        }
        INFO(text << ": from " << eye.x << ", " << eye.y << ", " << eye.z << " towards " << way.x << ", "
                  << way.y << ", " << way.z << " " << scene.materials[mesh.materials[seen.triangle]].name);
        CHECK((seen.front || masked(scene, mesh, seen.triangle)));
        // What was hit is in the air too: go on from there, away from the surface.
        if (!seen.front || masked(scene, mesh, seen.triangle)) continue;
        const dvec3 normal = glm::normalize(area_vector(corners(mesh, seen.triangle)));
        dvec3 next = direction(random);
        if (glm::dot(next, normal) < 0) next = -next;
        const Seen then =
            nearest(mesh, eye + way * seen.distance + normal * 1e-5, next, [](std::size_t) { return false; });
        if (!std::isinf(then.distance)) CHECK((then.front || masked(scene, mesh, then.triangle)));
      }
    CHECK(sky < rays / 5);  // through windows
    CHECK(sky > 0);
  }
}

// Catches: a camera in a column, or outside.
TEST_CASE("the hall's cameras stand free and inside", "[hall]") {
  for (const char* text :
       {"detail=1,bays=3", "detail=1,bays=8,angle=30", "detail=1,bays=13,angle=-100,tilt=5"}) {
    const Scene scene = hall(text + std::string(",textures=0"));
    const Mesh mesh = whole(scene);
    const Box box = bounds(scene);
    CHECK(scene.views.size() >= 5);
    CHECK(scene.views[0].camera.eye == scene.camera.eye);
    std::set<std::string> names;
    for (const View& view : scene.views) {
      INFO(text << ", " << view.name);
      CHECK(names.insert(view.name).second);
      const dvec3 eye = view.camera.eye;
      for (int k = 0; k < 3; ++k) CHECK((eye[k] > box.lower[k] && eye[k] < box.upper[k]));
      double distance = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        distance = std::min(distance, distance_to(eye, corners(mesh, i)));
      CHECK(distance > 0.5);
      CHECK(std::abs(glm::dot(glm::normalize(view.camera.target - view.camera.eye), view.camera.up)) < 0.95f);
      // What it looks at is seen: nothing stands right before it.
      const dvec3 way = glm::normalize(dvec3(view.camera.target) - eye);
      CHECK(nearest(mesh, eye, way, [](std::size_t) { return false; }).distance > 1.2);
    }
  }
}

// Catches: an angle that turns some things and not others, turns the other way, or rounds more than once.
TEST_CASE("a turned hall is the hall, turned", "[hall]") {
  const auto made = [](const std::string& angle) { return hall("detail=1,bays=3,textures=0" + angle); };
  const Scene straight = made("");
  const Mesh before = whole(straight);
  const auto compare = [&](const Scene& scene, const glm::dmat3& rotation, double tolerance) {
    const Mesh after = whole(scene);
    REQUIRE(after.positions.size() == before.positions.size());
    CHECK(after.triangles == before.triangles);
    CHECK(after.texture_coordinates == before.texture_coordinates);
    double worst = 0, worst_normal = 0;
    for (std::size_t i = 0; i < before.positions.size(); ++i) {
      worst = std::max(worst, glm::length(rotation * dvec3(before.positions[i]) - dvec3(after.positions[i])));
      worst_normal =
          std::max(worst_normal, glm::length(rotation * dvec3(before.normals[i]) - dvec3(after.normals[i])));
    }
    CHECK(worst <= tolerance);
    CHECK(worst_normal < 3e-7);
    for (std::size_t i = 0; i < scene.lights.size(); ++i) {
      if (scene.lights[i].kind == Light::Kind::directional)
        CHECK(glm::length(rotation * dvec3(straight.lights[i].direction) - dvec3(scene.lights[i].direction)) <
              1e-5);
      CHECK(glm::length(rotation * dvec3(straight.lights[i].position) - dvec3(scene.lights[i].position)) <
            1e-5);
    }
    CHECK(glm::length(rotation * dvec3(straight.camera.eye) - dvec3(scene.camera.eye)) < 1e-5);
    CHECK(glm::length(rotation * dvec3(straight.camera.up) - dvec3(scene.camera.up)) < 1e-6);
  };
  // Each coordinate is rounded once, before and after: half a unit in the last place of at most 32 m each.
  const double rounding = std::sqrt(3.0) * 2 * 0x1p-24 * 32;
  compare(made(",angle=30"), turned(1, 30), rounding);
  compare(made(",angle=-123.4"), turned(1, -123.4), rounding);
  compare(made(",angle=20,tilt=35"), turned(0, 35) * turned(1, 20), rounding);
  compare(made(",angle=90"), turned(1, 90), 0);
  compare(made(",angle=180"), turned(1, 180), 0);
}

// Catches: texture coordinates that are stretched, of another scale than their texture was made for, or
// mirrored where a normal map reads them.
TEST_CASE("the hall's texture coordinates are even and right-handed", "[hall]") {
  const Scene scene = hall("detail=4,bays=3,textures=8");
  const Mesh mesh = whole(scene);
  for (int m = 0; m < hall_texture_count; ++m) {
    const HallTextureFacts& about = facts(static_cast<HallTexture>(m));
    INFO(about.name);
    CHECK(scene.materials[std::size_t(m)].name == about.name);
    double area = 0, well = 0, mirrored = 0, stretched = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      if (mesh.materials[i] != std::uint32_t(m)) continue;
      const uvec3& t = mesh.triangles[i];
      const auto uv = [&](std::uint32_t k) {
        const vec2 v = mesh.texture_coordinates[k] * about.period;
        return dvec3(v.x, v.y, 0);
      };
      const Triangle metres = corners(mesh, i), texels{uv(t.x), uv(t.y), uv(t.z)};
      const double a = glm::length(area_vector(metres)), b = area_vector(texels).z;
      area += a;
      if (b <= 0) mirrored += a;
      const double scale = std::sqrt(std::abs(b) / a);
      if (scale > 0.6 && scale < 1.7) well += a;
      // Singular values of the map from the surface to its texture: sides tell enough.
      for (const auto& [p, q] : {std::pair{metres.b - metres.a, texels.b - texels.a},
                                 {metres.c - metres.b, texels.c - texels.b},
                                 {metres.a - metres.c, texels.a - texels.c}})
        if (glm::length(q) > 2.5 * glm::length(p) || glm::length(p) > 2.5 * glm::length(q)) {
          stretched += a;
          break;
        }
    }
    REQUIRE(area > 0);
    CHECK(mirrored <= 0);
    CHECK(well / area > 0.85);
    CHECK(stretched / area < 0.1);
  }
}

// Catches: a seam where a texture repeats, colours no stone has, an alpha mask that is all or nothing, and
// normal maps that lean backwards.
TEST_CASE("the hall's textures tile and are in range", "[hall]") {
  constexpr int size = 128;
  for (int m = 0; m < hall_texture_count; ++m) {
    const auto which = static_cast<HallTexture>(m);
    INFO(facts(which).name);
    const HallTexels texels = hall_texels(which, size);
    REQUIRE(texels.colours.size() == std::size_t(size * size));
    CHECK(texels.normals.size() == (facts(which).has_normals ? texels.colours.size() : 0));
    const auto at = [&](const std::vector<u8vec4>& list, int x, int y) {
      return dvec3(list[std::size_t((y + size) % size * size + (x + size) % size)]);
    };
    for (const auto* list : {&texels.colours, &texels.normals}) {
      if (list->empty()) continue;
      // The mean difference of neighbours in columns x − 1 and x, and in rows: the seam is no worse than the
      // worst elsewhere.
      const auto step = [&](int k, bool rows) {
        double sum = 0;
        for (int i = 0; i < size; ++i)
          sum += rows ? glm::length(at(*list, i, k) - at(*list, i, k - 1))
                      : glm::length(at(*list, k, i) - at(*list, k - 1, i));
        return sum / size;
      };
      for (const bool rows : {false, true}) {
        double worst = 0;
        for (int k = 1; k < size; ++k) worst = std::max(worst, step(k, rows));
        CHECK(step(0, rows) <= worst * 1.001 + 0.5);
      }
    }
    std::size_t there = 0;
    for (const u8vec4& t : texels.colours) there += t.w > 0;
    if (which == HallTexture::grille)
      CHECK((there > texels.colours.size() / 5 && there < texels.colours.size() * 3 / 4));
    else
      CHECK(there == texels.colours.size());
    const vec3 mean = hall_mean_colour(which);
    const float brightness = (mean.x + mean.y + mean.z) / 3;
    CHECK((brightness > 0.05f && brightness < 0.75f));
    dvec3 sum(0);
    for (const u8vec4& t : texels.normals) {
      const dvec3 n = dvec3(t) / 127.5 - 1.0;
      sum += n;
      REQUIRE(std::abs(glm::length(n) - 1) < 0.02);
      REQUIRE(n.z > 0);
    }
    if (!texels.normals.empty()) {  // as much to one side as to the other
      CHECK(std::abs(sum.x) < 0.02 * size * size);
      CHECK(std::abs(sum.y) < 0.02 * size * size);
    }
  }
}

// Catches: a sun that no window lets in, or a roof that is not there.
TEST_CASE("the sun makes patches on the hall's floor", "[hall]") {
  const Scene scene = hall("detail=1,bays=5,textures=0");
  const Mesh mesh = whole(scene);
  const Light& sun = scene.lights[0];
  REQUIRE(sun.kind == Light::Kind::directional);
  CHECK(glm::length(dvec3(sun.direction)) == Approx(1));
  Random random(3);
  int lit = 0;
  constexpr int points = 300;
  for (int i = 0; i < points; ++i) {
    const dvec3 point(24 * (random.uniform_double() - 0.5), 0.01, 6.4 * (random.uniform_double() - 0.5));
    lit +=
        std::isinf(nearest(mesh, point, -dvec3(sun.direction), [](std::size_t) { return false; }).distance);
  }
  CHECK(lit > points / 50);
  CHECK(lit < points / 3);
}
