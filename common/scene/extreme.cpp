#include "common/scene/extreme.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "common/math/random.h"
#include "common/math/turn.h"

namespace trilha {
namespace {

std::vector<vec3> placed(const std::vector<dvec3>& points, double scale, const dvec3& centre) {
  std::vector<vec3> result;
  result.reserve(points.size());
  for (const dvec3& point : points) result.push_back(scale * point + centre);
  return result;
}

// North pole, stacks − 1 rings from north to south, south pole.
std::vector<dvec3> sphere_points(int slices, int stacks) {
  std::vector<dvec3> points{{0, 0, 1}};
  for (int i = 1; i < stacks; ++i) {
    const auto [height, radius] = turn(180.0 * i / stacks);
    for (int j = 0; j < slices; ++j) {
      const auto [cosine, sine] = turn(360.0 * j / slices);
      points.push_back({radius * cosine, radius * sine, height});
    }
  }
  points.push_back({0, 0, -1});
  return points;
}

std::vector<uvec3> sphere_triangles(std::uint32_t slices, std::uint32_t stacks) {
  std::vector<uvec3> triangles;
  const std::uint32_t rings = stacks - 1, south = 1 + rings * slices;
  for (std::uint32_t j = 0; j < slices; ++j) {
    const std::uint32_t next = (j + 1) % slices;
    triangles.push_back({0, 1 + j, 1 + next});
    for (std::uint32_t i = 0; i + 1 < rings; ++i) {
      const std::uint32_t north = 1 + i * slices, below = north + slices;
      triangles.push_back({north + j, below + j, below + next});
      triangles.push_back({north + j, below + next, north + next});
    }
    const std::uint32_t last = 1 + (rings - 1) * slices;
    triangles.push_back({last + j, south, last + next});
  }
  return triangles;
}

}  // namespace

Mesh icosphere(int subdivisions, double scale, const dvec3& centre) {
  const double g = (1 + std::sqrt(5.0)) / 2;  // three golden rectangles, crossed
  std::vector<dvec3> points{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                            {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (dvec3& point : points) point = glm::normalize(point);
  std::vector<uvec3> triangles{{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int level = 0; level < subdivisions; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [found, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (is_new) points.push_back(glm::normalize(points[a] + points[b]));
      return found->second;
    };
    std::vector<uvec3> finer;
    finer.reserve(4 * triangles.size());
    for (const uvec3& t : triangles) {
      const std::uint32_t xy = middle(t.x, t.y), yz = middle(t.y, t.z), zx = middle(t.z, t.x);
      finer.insert(finer.end(), {{t.x, xy, zx}, {t.y, yz, xy}, {t.z, zx, yz}, {xy, yz, zx}});
    }
    triangles = std::move(finer);
  }
  Mesh mesh;
  mesh.name = "icosphere";
  mesh.positions = placed(points, scale, centre);
  mesh.triangles = std::move(triangles);
  return mesh;
}

Mesh latitude_longitude_sphere(int slices, int stacks, double scale, const dvec3& centre) {
  Mesh mesh;
  mesh.name = "latitude-longitude sphere";
  mesh.positions = placed(sphere_points(slices, stacks), scale, centre);
  mesh.triangles = sphere_triangles(static_cast<std::uint32_t>(slices), static_cast<std::uint32_t>(stacks));
  return mesh;
}

Mesh spiky_sphere(int slices, int stacks, std::uint64_t seed, double scale, const dvec3& centre) {
  std::vector<dvec3> points = sphere_points(slices, stacks);
  Random random(seed);
  for (dvec3& point : points) point *= 1 + 5 * random.uniform_double();
  Mesh mesh;
  mesh.name = "spiky sphere";
  mesh.positions = placed(points, scale, centre);
  mesh.triangles = sphere_triangles(static_cast<std::uint32_t>(slices), static_cast<std::uint32_t>(stacks));
  return mesh;
}

// ---- the cases -----------------------------------------------------------------

namespace {

/// A direction far from every axis: where "sizes away" leads.
const dvec3 away = glm::normalize(dvec3(148376, 1234, -223423));

Ray ray_to(const dvec3& origin, const dvec3& direction) {
  Ray ray;
  ray.origin = vec3(origin);
  ray.direction = vec3(direction);
  return ray;
}

/// What a pinhole at `centre + scale·eye` sees that looks at the centre, 26 degrees up and down.
std::vector<Ray> view(int width, int height, double scale, const dvec3& centre,
                      const dvec3& eye = dvec3(0.5, 0.4, 3)) {
  const dvec3 forward = glm::normalize(-eye), right = glm::normalize(glm::cross(forward, dvec3(0, 1, 0)));
  const dvec3 up = glm::cross(right, forward);
  std::vector<Ray> rays;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double sx = (2 * (x + 0.5) / width - 1) * width / height, sy = 1 - 2 * (y + 0.5) / height;
      rays.push_back(ray_to(centre + scale * eye, glm::normalize(forward + 0.42 * (sx * right + sy * up))));
    }
  return rays;
}

/// The icosphere of 1280 triangles, of any size and anywhere, and a view of it.
ExtremeTrial sphere_view(int width, int height, double scale, double sizes_away) {
  const dvec3 centre = away * (sizes_away * scale);
  return {icosphere(3, scale, centre), view(width, height, scale, centre), width, height};
}

/// Every coordinate times the factors: mesh and rays alike, so that the exact picture stays the same.
ExtremeTrial stretched(ExtremeTrial trial, const dvec3& factors) {
  for (vec3& p : trial.mesh.positions) p = vec3(dvec3(p) * factors);
  for (Ray& ray : trial.rays)
    ray = ray_to(dvec3(ray.origin) * factors, glm::normalize(dvec3(ray.direction) * factors));
  return trial;
}

/// A sphere seen from near its middle, with a vertex for every pixel: each ray goes to a vertex, or to a
/// point of the edge from it to its southern neighbour.
ExtremeTrial panorama(int width, int height, bool edges) {
  ExtremeTrial trial{latitude_longitude_sphere(width, height + 1), {}, width, height};
  Random random(1);
  const dvec3 origin(vec3(0.05f, -0.03f, 0.02f));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto vertex = [&](int ring) {  // ring −1 is the north pole
        return dvec3(trial.mesh.positions[static_cast<std::size_t>(ring < 0 ? 0 : 1 + ring * width + x)]);
      };
      dvec3 target = vertex(y);
      if (edges) target += (vertex(y - 1) - target) * random.uniform_double();
      trial.rays.push_back(ray_to(origin, glm::normalize(target - origin)));
    }
  return trial;
}

/// The cube ±1 with faces of n×n cells, all vertices multiples of 2/n: exact in float.
Mesh lattice_cube(int n) {
  Mesh mesh;
  for (int face = 0; face < 6; ++face) {
    const int axis = face % 3, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const float side = face < 3 ? 1.0f : -1.0f;
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    const auto row = static_cast<std::uint32_t>(n + 1);
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j) {
        vec3 p;
        p[axis] = side;
        p[u] = side * (2 * static_cast<float>(i) / static_cast<float>(n) - 1);
        p[v] = 2 * static_cast<float>(j) / static_cast<float>(n) - 1;
        mesh.positions.push_back(p);
      }
    for (std::uint32_t i = 0; i + 1 < row; ++i)
      for (std::uint32_t j = 0; j + 1 < row; ++j) {
        const std::uint32_t a = first + i * row + j;
        mesh.triangles.push_back({a, a + row, a + row + 1});
        mesh.triangles.push_back({a, a + row + 1, a + 1});
      }
  }
  return mesh;
}

/// Rays down the z axis on a lattice that meets vertices, edges and diagonals of the cube's cells.
ExtremeTrial along_axis(int width, int height, bool nearly) {
  ExtremeTrial trial{lattice_cube(8), {}, width, height};
  const float small[4] = {0.0f, -0.0f, 1e-42f, -1e-42f};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      Ray ray;
      // sixteenths, from beyond one side to beyond the other
      ray.origin = {static_cast<float>(x - width / 2) / 16, static_cast<float>(height / 2 - y) / 16, 4};
      ray.direction = {0, 0, -1};
      if (nearly) ray.direction = {small[x % 4], small[y % 4], -1};
      trial.rays.push_back(ray);
    }
  return trial;
}

/// Rays that touch the sphere's outline: each in the plane of a triangle, nearly, past one of its edges.
ExtremeTrial grazing(int width, int height) {
  ExtremeTrial trial{icosphere(3), {}, width, height};
  Random random(2);
  for (int i = 0; i < width * height; ++i) {
    const uvec3 t = trial.mesh.triangles[random.index(1280)];
    const dvec3 a(trial.mesh.positions[t.x]), b(trial.mesh.positions[t.y]), c(trial.mesh.positions[t.z]);
    const double u = random.uniform_double(), v = random.uniform_double() * (1 - u);
    const auto [cosine, sine] = turn(360 * random.uniform_double());
    const dvec3 e = glm::normalize(b - a), n = glm::normalize(glm::cross(b - a, c - a));
    const dvec3 along = cosine * e + sine * glm::cross(n, e);
    const dvec3 target = a + u * (b - a) + v * (c - a);
    const double tilt = 1e-7 * (2 * random.uniform_double() - 1);
    trial.rays.push_back(ray_to(target - 2.0 * (along + tilt * n), along + tilt * n));
  }
  return trial;
}

/// Rays that start on the sphere, where a view sees it and as a float can say where, and leave it for a
/// light: shadow rays. Pixels beside the sphere send theirs away from it.
ExtremeTrial leaving(int width, int height) {
  ExtremeTrial trial = sphere_view(width, height, 1, 0);
  const dvec3 light(3, 4, 5);
  for (Ray& ray : trial.rays) {
    const dvec3 o(ray.origin), d(ray.direction);
    double nearest = std::numeric_limits<double>::infinity();
    dvec3 normal(0);
    for (const uvec3& t : trial.mesh.triangles) {  // Möller–Trumbore in double
      const dvec3 a(trial.mesh.positions[t.x]), e1 = dvec3(trial.mesh.positions[t.y]) - a,
                                                e2 = dvec3(trial.mesh.positions[t.z]) - a;
      const dvec3 p = glm::cross(d, e2), s = o - a, q = glm::cross(s, e1);
      const double det = glm::dot(e1, p), u = glm::dot(s, p) / det, v = glm::dot(d, q) / det;
      const double along = glm::dot(e2, q) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && along < nearest) nearest = along, normal = glm::cross(e1, e2);
    }
    if (nearest == std::numeric_limits<double>::infinity()) {
      ray.direction = -ray.direction;
      continue;
    }
    const dvec3 start = o + nearest * d, to_light = glm::normalize(light - start);
    ray = ray_to(start, glm::dot(to_light, normal) < 0 ? -to_light : to_light);
  }
  return trial;
}

/// The sphere and triangles that must never be hit, each on top of a sound one.
ExtremeTrial with_triangles(int width, int height,
                            const std::function<void(Mesh&, std::uint32_t sound)>& add) {
  ExtremeTrial trial = sphere_view(width, height, 1, 0);
  for (std::uint32_t i = 0; i < 1280; ++i) add(trial.mesh, i);
  return trial;
}

void add_without_area(Mesh& mesh, std::uint32_t sound) {
  const uvec3 t = mesh.triangles[sound];
  const vec3 a = mesh.positions[t.x], b = mesh.positions[t.y];
  const auto middle = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back(a + (b - a) * 0.5f);
  mesh.triangles.push_back({t.x, t.x, t.x});     // a point
  mesh.triangles.push_back({t.x, t.y, t.x});     // an edge
  mesh.triangles.push_back({t.x, t.y, middle});  // nearly an edge
}

void add_not_finite(Mesh& mesh, std::uint32_t sound) {
  const uvec3 t = mesh.triangles[sound];
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const float values[3] = {nan, inf, -inf};
  const auto bad = static_cast<std::uint32_t>(mesh.positions.size());
  vec3 p = mesh.positions[t.x];
  p[static_cast<int>(sound / 3 % 3)] = values[sound % 3];
  mesh.positions.push_back(p);
  mesh.triangles.push_back({bad, t.y, t.z});
}

/// Triangles of all sizes and turns about one point: their centroids are the same, up to rounding.
ExtremeTrial one_centroid(int width, int height) {
  ExtremeTrial trial{{}, view(width, height, 1, dvec3(0)), width, height};
  Random random(4);
  for (std::uint32_t i = 0; i < 300; ++i) {
    const double x = random.uniform_double(), y = random.uniform_double(), z = random.uniform_double();
    const double size = random.uniform_double();
    const dvec3 n = glm::normalize(dvec3(2 * x - 1, 2 * y - 1, 2 * z - 1));
    const dvec3 e = glm::normalize(glm::cross(n, std::fabs(n.x) < 0.5 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
    for (int k = 0; k < 3; ++k) {
      const auto [cosine, sine] = turn(120.0 * k);
      trial.mesh.positions.push_back(vec3(size * 1.2 * (cosine * e + sine * glm::cross(n, e))));
    }
    trial.mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return trial;
}

/// A floor of 512 triangles, seen at a slope of 1e-5.
ExtremeTrial nearly_edge_on(int width, int height) {
  ExtremeTrial trial{{}, {}, width, height};
  const std::uint32_t n = 16;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j)
      trial.mesh.positions.push_back(vec3(dvec3(2.0 * i / n - 1, 0, 2.0 * j / n - 1)));
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j;
      trial.mesh.triangles.push_back({a, a + 1, a + n + 2});
      trial.mesh.triangles.push_back({a, a + n + 2, a + n + 1});
    }
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const dvec3 origin(0, 3e-5, 3),
          target(2.4 * (x + 0.5) / width - 1.2, 0, 2.4 * (y + 0.5) / height - 1.2);
      trial.rays.push_back(ray_to(origin, glm::normalize(target - origin)));
    }
  return trial;
}

}  // namespace

std::vector<ExtremeCase> extreme_cases() {
  std::vector<ExtremeCase> cases;
  const auto sphere = [&](const std::string& name, const std::string& what, double scale, double sizes_away) {
    cases.push_back({name, what, [=](int w, int h) { return sphere_view(w, h, scale, sizes_away); }});
  };
  sphere("ordinary", "a sphere of 1280 triangles, radius 1, about the origin", 1, 0);
  sphere("size 1e-18", "the same sphere and view, 10¹⁸ times smaller", 1e-18, 0);
  sphere("size 1e-9", "10⁹ times smaller", 1e-9, 0);
  sphere("size 1e9", "10⁹ times larger", 1e9, 0);
  sphere("size 1e18", "10¹⁸ times larger", 1e18, 0);
  sphere("1e3 sizes away", "moved by 10³ radii", 1, 1e3);
  sphere("1e5 sizes away", "moved by 10⁵ radii; a float's step is 2⁻⁷ there", 1, 1e5);
  sphere("1e7 sizes away",
         "moved by 10⁷ radii; a float's step is 1, and the mesh is what rounding left of it", 1, 1e7);
  sphere("size 1e-18, 1e5 sizes away", "both", 1e-18, 1e5);
  sphere("size 1e18, 1e5 sizes away", "both", 1e18, 1e5);
  cases.push_back({"slivers",
                   "the sphere pressed flat to 10⁻⁷, and the rays with it: triangles of aspect 10⁷",
                   [](int w, int h) {
                     return stretched(sphere_view(w, h, 1, 0), {1, 1e-7, 1});
                   }});
  cases.push_back({"sizes 1 and 1e6", "the sphere within one a million times larger", [](int w, int h) {
                     ExtremeTrial trial = sphere_view(w, h, 1, 0);
                     for (const vec3& p : icosphere(1, 1e6).positions) trial.mesh.positions.push_back(p);
                     for (const uvec3& t : icosphere(1).triangles)
                       trial.mesh.triangles.push_back(
                           t + static_cast<std::uint32_t>(icosphere(3).positions.size()));
                     return trial;
                   }});
  cases.push_back(
      {"spikes", "from inside a star of 420 long triangles that hide each other", [](int w, int h) {
         return ExtremeTrial{spiky_sphere(15, 15, 1), view(w, h, 1, dvec3(0), dvec3(0.1, 0.2, 0.3)), w, h};
       }});
  for (const double length : {1e-15, 1e15})
    cases.push_back({length < 1 ? "directions 1e-15 long" : "directions 1e15 long",
                     "the ordinary view, with directions that are not normalised", [length](int w, int h) {
                       ExtremeTrial trial = sphere_view(w, h, 1, 0);
                       for (Ray& ray : trial.rays) ray.direction *= static_cast<float>(length);
                       return trial;
                     }});
  cases.push_back({"along axes",
                   "rays down an axis that meet vertices, edges and diagonals of a lattice exactly",
                   [](int w, int h) { return along_axis(w, h, false); }});
  cases.push_back({"nearly along axes", "the same, the direction's other components 0, −0 and subnormal",
                   [](int w, int h) { return along_axis(w, h, true); }});
  cases.push_back({"at vertices", "from inside a sphere, every ray at a vertex",
                   [](int w, int h) { return panorama(w, h, false); }});
  cases.push_back({"at edges", "… at a point of an edge", [](int w, int h) { return panorama(w, h, true); }});
  cases.push_back({"grazing", "rays within 10⁻⁷ of the plane of a triangle of the sphere", grazing});
  cases.push_back({"nearly edge-on", "a floor of 512 triangles seen at a slope of 10⁻⁵", nearly_edge_on});
  cases.push_back({"starting on the surface",
                   "rays that leave the sphere from points that a view sees, as rounded", leaving});
  cases.push_back({"no area", "three triangles without area on each sound one",
                   [](int w, int h) { return with_triangles(w, h, add_without_area); }});
  cases.push_back({"repeated", "every triangle twice", [](int w, int h) {
                     return with_triangles(w, h, [](Mesh& mesh, std::uint32_t sound) {
                       mesh.triangles.push_back(mesh.triangles[sound]);
                     });
                   }});
  cases.push_back({"one centroid", "300 triangles of all sizes about the same point", one_centroid});
  cases.push_back({"NaN and infinity", "on each sound triangle one with a vertex that is no number",
                   [](int w, int h) { return with_triangles(w, h, add_not_finite); }});
  cases.push_back(
      {"rays of NaN and infinity", "every other ray has a component that is no number", [](int w, int h) {
         ExtremeTrial trial = sphere_view(w, h, 1, 0);
         const float inf = std::numeric_limits<float>::infinity();
         for (std::size_t i = 0; i < trial.rays.size(); i += 2) {
           vec3& v = i % 4 == 0 ? trial.rays[i].origin : trial.rays[i].direction;
           v[static_cast<int>(i / 4 % 3)] = i % 8 < 4 ? inf - inf : inf;
         }
         return trial;
       }});
  return cases;
}

}  // namespace trilha
