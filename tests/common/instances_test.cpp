// Meshes placed by transforms: what flattening makes of them, what the scene says of itself, and where the
// camera is put.

#include <cmath>

#include "common/error.h"
#include "common/math/random.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"
#include "tests/testing.h"

using namespace trilha;

namespace {

double uniform(Random& random, double low, double high) { return low + (high - low) * random.uniform(); }

/// Any affine map whose columns are up to 2 long and do not nearly lie in a plane.
Transform random_transform(Random& random) {
  for (;;) {
    Transform m(1);
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 3; ++row) m[column][row] = uniform(random, -2, 2);
    if (std::abs(determinant(m)) > 0.1) return m;
  }
}

double volume(const Mesh& mesh) {
  double sum = 0;
  for (const uvec3& t : mesh.triangles)
    sum += glm::dot(dvec3(mesh.positions[t.x]),
                    glm::cross(dvec3(mesh.positions[t.y]), dvec3(mesh.positions[t.z]))) /
           6;
  return sum;
}

Scene scene_of(std::vector<Mesh> meshes) {
  Scene scene;
  scene.name = "test";
  scene.meshes = std::move(meshes);
  return scene;
}

/// The inside of a box, fronts inwards, without the face that lies at `open` (0…5: −x +x −y +y −z +z).
Mesh box_room(const dvec3& size, int open = -1) {
  Mesh mesh;
  for (int face = 0; face < 6; ++face) {
    if (face == open) continue;
    const int axis = face / 2, a = (axis + 1) % 3, b = (axis + 2) % 3;
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int corner = 0; corner < 4; ++corner) {
      dvec3 p(0);
      p[axis] = face % 2 ? size[axis] : 0;
      p[a] = (corner == 1 || corner == 2) ? size[a] : 0;
      p[b] = corner >= 2 ? size[b] : 0;
      mesh.positions.push_back(p);
    }
    if (face % 2 == 0) {  // a × b points along +axis: inwards
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
    } else {
      mesh.triangles.push_back({first, first + 2, first + 1});
      mesh.triangles.push_back({first, first + 3, first + 2});
    }
  }
  return mesh;
}

bool inside(const Box& box, const vec3& p) {
  return glm::all(glm::greaterThan(p, box.lower)) && glm::all(glm::lessThan(p, box.upper));
}

dvec3 looks(const Camera& camera) { return glm::normalize(dvec3(camera.target) - dvec3(camera.eye)); }

}  // namespace

// Catches: rows for columns, the order of a product, mirrored triangles left turned over, normals that are
// moved like positions.
TEST_CASE("a placed body keeps its outside outside, whatever shears and mirrors it") {
  Random random(7, 0);
  Mesh sphere = icosphere(2);
  make_normals(sphere);
  const double own_volume = volume(sphere);
  int mirrored = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Scene scene = scene_of({sphere});
    const Transform m = random_transform(random);
    mirrored += mirrors(m);
    scene.instances = {{0, -1, m}};
    const Mesh flat = flattened(scene, {true, false, false});
    REQUIRE(flat.positions.size() == sphere.positions.size());
    CHECK(volume(flat) == Approx(std::abs(determinant(m)) * own_volume).epsilon(1e-4));
    const dvec3 centre = m[3];
    for (std::size_t i = 0; i < flat.positions.size(); ++i) {
      CHECK(vec3(apply(m, dvec3(sphere.positions[i]))) == flat.positions[i]);
      // n is the gradient of |m⁻¹(p)|: at right angles to every tangent's image
      const dvec3 n = sphere.normals[i], p = sphere.positions[i];
      const dvec3 tangent =
          glm::normalize(glm::cross(n, std::abs(n.x) < 0.5 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
      const dvec3 moved = glm::normalize(linear_part(m) * tangent);
      REQUIRE(std::abs(glm::dot(moved, dvec3(flat.normals[i]))) < 1e-6);
      REQUIRE(glm::dot(dvec3(flat.normals[i]), apply(m, p) - centre) > 0);
      REQUIRE(glm::length(flat.normals[i]) == Approx(1).epsilon(1e-6));
    }
  }
  CHECK(mirrored > 50);
  CHECK(mirrored < 150);
}

// Catches: normals of instances that vanish or overflow on the way.
TEST_CASE("normals survive scales of 1e±18 and 1e6 to 1") {
  Mesh sphere = icosphere(1);
  make_normals(sphere);
  for (const dvec3 scale : {dvec3(1e18), dvec3(1e-18), dvec3(1e6, 1, 1), dvec3(1, -1e-6, 1)}) {
    Scene scene = scene_of({sphere});
    scene.instances = {{0, -1, linear(glm::dmat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z))}};
    const Mesh flat = flattened(scene, {true, false, false});
    for (std::size_t i = 0; i < flat.normals.size(); ++i) {
      const dvec3 expected = glm::normalize(dvec3(sphere.normals[i]) / scale);
      CHECK(glm::length(expected - dvec3(flat.normals[i])) < 1e-6);
    }
  }
}

// Catches: an override that is ignored or leaks, a mesh without materials that shifts those after it.
TEST_CASE("materials and texture coordinates stay with their triangles and vertices") {
  Mesh plain = icosphere(0), painted = icosphere(0);
  for (std::size_t i = 0; i < painted.triangles.size(); ++i) painted.materials.push_back(i % 2 ? 2 : 1);
  painted.texture_coordinates.assign(painted.positions.size(), vec2(0.25f, 0.75f));
  Scene scene = scene_of({plain, painted});
  scene.materials.resize(5);
  scene.instances = {{1, -1, identity()}, {0, -1, identity()}, {1, 4, identity()}, {0, 3, identity()}};
  const Mesh flat = flattened(scene, {false, true, true});
  REQUIRE(flat.materials.size() == 80);
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK(flat.materials[i] == (i % 2 ? 2 : 1));
    CHECK(flat.materials[20 + i] == 0);
    CHECK(flat.materials[40 + i] == 4);
    CHECK(flat.materials[60 + i] == 3);
  }
  REQUIRE(flat.texture_coordinates.size() == 48);
  CHECK(flat.texture_coordinates[0] == vec2(0.25f, 0.75f));
  CHECK(flat.texture_coordinates[12] == vec2(0));
  CHECK(flat.texture_coordinates[24] == vec2(0.25f, 0.75f));
  CHECK(flat.triangles[20].x >= 12);
  CHECK(flat.triangles[20].x < 24);
}

// Catches: gigabytes asked for before anyone counts; a large mesh of a large file taken for a bomb.
TEST_CASE("instances that make far more triangles than there are, are refused before any is made") {
  Scene scene = scene_of({icosphere(5)});  // 20 480 triangles
  for (const std::size_t instances : {std::size_t{300000}, std::size_t{821}}) {
    scene.instances.assign(instances, Instance());
    CHECK_THROWS_AS(flattened(scene, {}), InputError);
  }
  scene.instances.assign(820, Instance());  // 819·20 480 < 2²⁴
  CHECK(flattened(scene, {}).triangles.size() == 820u * 20480);
}

// Catches: infinite positions that reach a structure.
TEST_CASE("an instance beyond the largest float is refused by the name of its mesh") {
  Mesh sphere = icosphere(0);
  sphere.name = "moon";
  Scene scene = scene_of({sphere});
  scene.instances = {{0, -1, linear(glm::dmat3(1e39))}};
  try {
    flattened(scene, {});
    FAIL("was not refused");
  } catch (const InputError& error) {
    CHECK(std::string(error.what()).find("'moon'") != std::string::npos);
  }
}

// Catches: bounds that forget an instance, a sphere, or turn inside out where a transform mirrors.
TEST_CASE("the bounds of a scene hold all that stands in it") {
  Random random(3, 0);
  for (int trial = 0; trial < 100; ++trial) {
    Scene scene = scene_of({icosphere(1), box_room({1, 2, 3})});
    for (std::uint32_t i = 0; i < 4; ++i) scene.instances.push_back({i % 2, -1, random_transform(random)});
    const Mesh flat = flattened(scene, {});
    const Box all = bounds(scene), tight = bounds(flat);
    CHECK(glm::all(glm::lessThanEqual(all.lower, tight.lower)));
    CHECK(glm::all(glm::greaterThanEqual(all.upper, tight.upper)));
  }
  Scene scene = scene_of({box_room({1, 2, 3})});
  scene.instances = {{0, -1, translation({5, 0, 0}) * linear(glm::dmat3(-2, 0, 0, 0, 1, 0, 0, 0, 1))}};
  scene.spheres = {{{0, 10, 0}, 2, 0}};
  CHECK(bounds(scene).lower == vec3(-2, 0, -2));
  CHECK(bounds(scene).upper == vec3(5, 12, 3));
}

// Catches: an epsilon that refuses what is merely very flat or very small, or lets through what has no
// inverse.
TEST_CASE("a transform is singular if and only if its columns lie in a plane") {
  const auto scaled = [](double x, double y, double z) {
    return linear(glm::dmat3(x, 0, 0, 0, y, 0, 0, 0, z));
  };
  CHECK_FALSE(is_singular(identity()));
  CHECK_FALSE(is_singular(scaled(1e6, 1, 1e-6)));
  CHECK_FALSE(is_singular(scaled(1e-150, 1e150, -1)));
  CHECK(is_singular(scaled(1, 0, 1)));
  CHECK(is_singular(scaled(1, NAN, 1)));
  CHECK(is_singular(scaled(1, INFINITY, 1)));
  CHECK(is_singular(translation({0, INFINITY, 0})));
  Random random(11, 0);
  for (int trial = 0; trial < 1000; ++trial) {
    Transform m = random_transform(random);
    CHECK_FALSE(is_singular(m));
    m[trial % 3] = m[(trial + 1) % 3] * uniform(random, -1, 1) + m[(trial + 2) % 3] * uniform(random, -1, 1);
    CHECK(is_singular(m));
  }
}

// Catches: features of what nobody sees, which would be built, uploaded and compiled in.
TEST_CASE("the features of a scene are those of what is placed, as it is placed") {
  Mesh painted = icosphere(0), unplaced = icosphere(0);
  painted.materials.assign(painted.triangles.size(), 1);
  make_normals(unplaced);
  Scene scene = scene_of({painted, unplaced});
  scene.materials.resize(3);
  scene.materials[1].reflection = vec3(0.5f);  // a mirror
  scene.materials[2].transmission = vec3(1);   // glass
  CHECK(features_of(scene).mirrors);
  CHECK(features_of(scene).normals);
  scene.instances = {{0, 2, identity()}};
  const SceneFeatures features = features_of(scene);
  CHECK_FALSE(features.mirrors);
  CHECK(features.glass);
  CHECK_FALSE(features.normals);
  CHECK(features.instances);
  CHECK(features.materials);
}

// Catches: a camera that stands before a wall, in a body or outside, where the scene is a room; and one put
// into what is none.
TEST_CASE("the camera stands in a room and before a body") {
  const vec3 up(0, 1, 0);
  for (const bool mirrored : {false, true}) {
    Scene room = scene_of({box_room({3, 2.5, 8})});
    if (mirrored) room.instances = {{0, -1, linear(glm::dmat3(1, 0, 0, 0, 1, 0, 0, 0, -1))}};
    const Box box = bounds(room);
    const Camera camera = framing(room, up);
    CHECK(inside(box, camera.eye));
    CHECK(std::abs(looks(camera).z) > 0.99);  // along its longest way
    CHECK(std::abs(camera.eye.z - box.centre().z) > 3);
    CHECK(std::abs(camera.target.z - camera.eye.z) > 2);
  }
  for (const int open : {4, 5}) {  // in at the door, not out
    const Scene box = scene_of({box_room({2, 2, 2.1}, open)});
    const Camera camera = framing(box, up);
    CHECK(inside(bounds(box), camera.eye));
    CHECK((open == 4 ? 1 : -1) * looks(camera).z > 0.99);
  }
  {  // a pillar in the middle of the room
    Scene room = scene_of({box_room({3, 2.5, 8}), icosphere(2, 0.3)});
    room.instances = {{0, -1, identity()}, {1, -1, translation({1.5, 1, 4})}};
    const Camera camera = framing(room, up);
    CHECK(inside(bounds(room), camera.eye));
    CHECK(glm::length(dvec3(1.5, 1, 4) - dvec3(camera.eye)) > 1);
  }
  for (const Mesh& body : {icosphere(3), spiky_sphere(15, 15, 1), latitude_longitude_sphere(20, 10)}) {
    const Scene scene = scene_of({body});
    CHECK_FALSE(inside(bounds(scene), framing(scene, up).eye));
  }
  Mesh floor = box_room({10, 1, 10});
  floor.triangles = {floor.triangles[4], floor.triangles[5]};  // y = 0 alone: half of the sphere at most
  CHECK(framing(scene_of({floor}), up).eye.y > 1);
  CHECK(std::isfinite(framing(scene_of({}), up).eye.x));
}

// Catches: an eye that is rounded onto its target, from which there is nothing to see.
TEST_CASE("even a scene that is smaller than floats can tell apart has a camera that looks somewhere") {
  for (const float x : {1e-45f, 1e-38f, 0.0f, -3e-41f}) {
    Mesh mesh;
    mesh.positions = {{x, 0, 0}, {0, x, 0}, {0, 0, x}};
    mesh.triangles = {{0, 1, 2}};
    for (Mesh some : {mesh, Mesh{"", {{x, 0, 0}}, {{0, 0, 0}}, {}, {}, {}}}) {
      const Camera camera = framing(scene_of({std::move(some)}), {0, 1, 0});
      CHECK(camera.eye != camera.target);
    }
  }
}

// Catches: a portrait that cuts off what the camera was meant to show.
TEST_CASE("in an image that is higher than wide the field of view becomes that of the width") {
  Camera camera;
  camera.field_of_view = 40;
  CHECK(for_aspect(camera, 4.0 / 3).field_of_view == 40);
  CHECK(for_aspect(camera, 1).field_of_view == 40);
  for (const double aspect : {0.9, 0.5, 0.1}) {
    const double half = std::tan(glm::radians(double(for_aspect(camera, aspect).field_of_view)) / 2);
    CHECK(half * aspect == Approx(std::tan(glm::radians(20.0))).epsilon(1e-5));
  }
}
