#include "chapters/02_whitted/stability.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "chapters/02_whitted/renderer.h"
#include "common/scene/extreme.h"

namespace trilha {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double u = unit_roundoff<float>;

// ---- what is tried and how it is judged --------------------------------------

/// What a ray should bring. The exact value lies in [low, high] if the surfaces' points are off by what
/// floats can be off there; where these differ a little offset decides much, and the ray is not sure.
struct Wanted {
  dvec3 value, low, high;
  dvec3 direction{0};  ///< in which the light leaves the scene; zero: not asked
  double angle = 0;    ///< how far off rounding may bring that, in radians
};

/// Rays in a square, and what they should bring.
struct Panel {
  Scene scene;
  std::vector<Ray> rays;
  std::vector<Wanted> wanted;
};

struct Technique {
  std::string name;
  std::function<void(WhittedSettings&)> set;
};

/// What a technique made of a panel.
struct Seen {
  std::vector<vec4> colours;
  std::vector<dvec3> directions;  ///< in which each ray's light left the scene; zero: it did not
};

enum class Outcome : std::uint8_t { right, lost, gained, bent, forbidden };

constexpr double tolerance = 0.01;  ///< of light, and of radians

/// Asks another tracer, and keeps the direction of each root's ray that met nothing. For scenes without
/// lamps whose rays do not branch: then the rays of a level are those that met something, in their order.
class LeavingRays final : public Tracer {
 public:
  LeavingRays(const Stream& stream, const Tracer& asked, std::size_t roots)
      : directions(roots, dvec3(0)), stream_(stream), asked_(asked), alive_(roots) {
    for (std::size_t i = 0; i < roots; ++i) alive_[i] = i;
  }

  void set_surely_ahead(bool) override {}  // as the one that is asked has it
  bool any_clear() const override { return asked_.any_clear(); }
  void closest(Among among, const Ray* rays, Hit* hits, std::size_t n) const override {
    asked_.closest(among, rays, hits, n);
    if (n != alive_.size()) alive_.clear();  // a ray ended in the middle of its way: its light is lost, too
    std::vector<Ray> host_rays(n);
    std::vector<Hit> host_hits(n);
    copy(host_rays.data(), Backend::cpu, rays, stream_.backend(), n * sizeof(Ray), stream_);
    copy(host_hits.data(), Backend::cpu, hits, stream_.backend(), n * sizeof(Hit), stream_);
    std::vector<std::size_t> on;
    for (std::size_t k = 0; k < alive_.size(); ++k)
      if (host_hits[k].found())
        on.push_back(alive_[k]);
      else
        directions[alive_[k]] = dvec3(host_rays[k].direction);
    alive_ = on;
  }
  void occluded(Among among, const Ray* rays, std::uint8_t* occluded, std::size_t n) const override {
    asked_.occluded(among, rays, occluded, n);
  }
  void meets(const Ray* rays, const std::uint32_t* primitives, std::uint8_t* met,
             std::size_t n) const override {
    asked_.meets(rays, primitives, met, n);
  }
  void probe(const Ray* rays, Probe* probes, std::size_t n) const override { asked_.probe(rays, probes, n); }

  mutable std::vector<dvec3> directions;

 private:
  const Stream& stream_;
  const Tracer& asked_;
  mutable std::vector<std::size_t> alive_;
};

Seen look(Backend backend, const Panel& panel, const WhittedSettings& settings) {
  const Stream stream(backend);
  const std::size_t n = panel.rays.size();
  const Buffer rays(stream, panel.rays);
  Buffer<vec4> colours(backend, n);
  Seen seen;
  const bool directions = std::any_of(panel.wanted.begin(), panel.wanted.end(),
                                      [](const Wanted& w) { return w.direction != dvec3(0); });
  if (directions && settings.kernel == Kernel::split && settings.terms.fresnel == Fresnel::constant) {
    const WhittedScene scene(panel.scene, settings, stream);
    StructureTracer tracer(scene, settings.test, brute_force(settings.test), stream);
    tracer.set_surely_ahead(surely_ahead(settings.terms));
    const LeavingRays leaving(stream, tracer, n);
    SplitTrees trees(stream);
    trees.colours(scene.view(), leaving, settings.terms, scene.features(), false, rays.data(), colours.data(),
                  n);
    seen.directions = leaving.directions;
  } else {
    WhittedRenderer renderer(panel.scene, settings, stream);
    renderer.colours(rays.data(), colours.data(), n);
  }
  seen.colours = colours.to_vector(stream);
  return seen;
}

double angle_between(const dvec3& a, const dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// The ray's outcome; `worst` becomes its error if that is larger, an angle or of light.
Outcome judged(const Wanted& wanted, const vec4& colour, const dvec3* direction, bool angles,
               std::optional<double>& worst) {
  Outcome outcome = Outcome::right;
  double off = 0;
  for (int c = 0; c < 3; ++c) {
    const double light = colour[c];
    if (!(light >= 0) || !std::isfinite(light)) return Outcome::forbidden;
    off = std::max(off, std::fabs(light - wanted.value[c]));
    if (light < wanted.low[c] - tolerance) outcome = Outcome::lost;
    if (light > wanted.high[c] + tolerance) outcome = Outcome::gained;
  }
  const dvec3 spread = wanted.high - wanted.low;
  const bool sure = std::max({spread.x, spread.y, spread.z}) <= tolerance && wanted.angle <= tolerance;
  const bool turns = direction != nullptr && wanted.direction != dvec3(0);
  if (turns) {
    const double angle = angle_between(*direction, wanted.direction);  // of a ray that did not leave: zero
    if (outcome == Outcome::right && sure && angle > wanted.angle + tolerance) outcome = Outcome::bent;
    if (angles) off = angle;
  }
  if (sure) worst = std::max(worst.value_or(0), off);
  return outcome;
}

vec3 colour_of(Outcome outcome, const vec4& seen) {
  switch (outcome) {  // the colours of Okabe & Ito, safe for the colour-blind
    case Outcome::lost:
      return {0.84f, 0.37f, 0.0f};
    case Outcome::gained:
      return {0.34f, 0.71f, 0.91f};
    case Outcome::bent:
      return {0.94f, 0.89f, 0.26f};
    case Outcome::forbidden:
      return {1, 0, 1};
    case Outcome::right:
      break;
  }
  return vec3(0.12f + 0.7f * std::min((seen.x + seen.y + seen.z) / 3, 1.0f));
}

StabilityRow judged_row(Backend backend, const std::vector<Panel>& panels, int side, int columns,
                        const WhittedSettings& settings, const std::string& unit) {
  StabilityRow row;
  row.backend = backend;
  row.unit = unit;
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  row.picture = {columns * side, rows * side, Encoding::display, {}};
  row.picture.pixels.resize(std::size_t(columns) * side * rows * side, vec3(0));
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const Seen seen = look(backend, panels[p], settings);
    for (std::size_t i = 0; i < panels[p].rays.size(); ++i) {
      const Outcome outcome =
          judged(panels[p].wanted[i], seen.colours[i],
                 seen.directions.empty() ? nullptr : &seen.directions[i], unit == "radians", row.worst);
      row.failures += outcome != Outcome::right;
      ++row.of;
      const std::size_t x = p % columns * side + i % side, y = p / columns * side + i / side;
      row.picture.pixels[y * columns * side + x] = colour_of(outcome, seen.colours[i]);
    }
  }
  return row;
}

// ---- the techniques ----------------------------------------------------------

/// A technique for each of the values, which `set` puts into the settings.
template <class Values, class Set>
std::vector<Technique> techniques(const Values& values, const Set& set) {
  std::vector<Technique> list;
  for (const auto value : values) list.push_back({name(value), [=](WhittedSettings& s) { set(s, value); }});
  return list;
}

std::vector<Technique> offsets() {
  return techniques(all_self_intersections,
                    [](WhittedSettings& s, SelfIntersection method) { s.terms.self_intersection = method; });
}
std::vector<Technique> tests() {
  return techniques(all_triangle_tests, [](WhittedSettings& s, TriangleTest test) { s.test = test; });
}
std::vector<Technique> kernels() {
  return techniques(all_kernels, [](WhittedSettings& s, Kernel kernel) { s.kernel = kernel; });
}
std::vector<Technique> fresnel_modes() {
  return techniques(all_fresnels, [](WhittedSettings& s, Fresnel fresnel) { s.terms.fresnel = fresnel; });
}

// ---- convex bodies in double -------------------------------------------------

/// A convex body: the half-spaces below its faces, or a ball. The origin is at its middle.
struct Convex {
  struct Face {
    dvec3 normal;
    double offset;
  };
  dvec3 middle{0};
  std::vector<Face> faces;
  double radius = 0;  ///< of a ball

  /// Where a ray from outside enters, or one from inside leaves: t and the outward normal there.
  bool meet(const dvec3& origin, const dvec3& d, bool entering, double& t, dvec3& normal) const {
    if (faces.empty()) {
      const double b = glm::dot(origin, d), a = glm::dot(d, d);
      const dvec3 across = origin - d * (b / a);
      const double left = radius * radius - glm::dot(across, across);
      if (left < 0 && entering) return false;
      t = (-b + (entering ? -1 : 1) * std::sqrt(std::max(left, 0.0) * a)) / a;
      normal = glm::normalize(origin + t * d);
      return t > 0 || !entering;
    }
    double in = -infinity, out = infinity;
    dvec3 in_normal(0), out_normal(0);
    for (const Face& face : faces) {
      const double slope = glm::dot(face.normal, d);
      const double way = (face.offset - glm::dot(face.normal, origin)) / slope;
      if (slope < 0 && way > in) in = way, in_normal = face.normal;
      if (slope > 0 && way < out) out = way, out_normal = face.normal;
    }
    t = entering ? in : std::max(out, 0.0);
    normal = entering ? in_normal : out_normal;
    return entering ? in > 0 && in < out : out < infinity;
  }
};

/// Of the mesh's triangles, all of which must be faces of a convex body; coincident planes do no harm.
Convex convex(const Mesh& mesh, const dvec3& middle) {
  Convex body;
  body.middle = middle;
  for (const uvec3& t : mesh.triangles) {
    const dvec3 a = dvec3(mesh.positions[t.x]) - middle, b = dvec3(mesh.positions[t.y]) - middle,
                c = dvec3(mesh.positions[t.z]) - middle;
    const dvec3 n = glm::normalize(glm::cross(b - a, c - a));
    body.faces.push_back({n, glm::dot(n, a)});
  }
  return body;
}

/// Points that are off by what floats may be: each is moved by up to `most` in every coordinate. Directions
/// are off by a few units in the last place.
struct Shake {
  Random random;
  double most;
  dvec3 within(double size) {
    dvec3 by;
    for (int k = 0; k < 3; ++k) by[k] = size * (2 * random.uniform_double() - 1);
    return by;
  }
  dvec3 operator()() { return within(most); }
  dvec3 turned(const dvec3& d) { return most > 0 ? glm::normalize(d + within(4 * u)) : d; }
};

dvec3 mirrored(const dvec3& d, const dvec3& n) { return d - 2 * glm::dot(d, n) * n; }

/// Snell's law for a normal against d; false in total reflection.
bool bent(const dvec3& d, const dvec3& n, double eta, dvec3& out) {
  const double c = -glm::dot(d, n);
  const dvec3 along = d + c * n;
  const double k = 1 - eta * eta * glm::dot(along, along);
  if (k < 0) return false;
  out = glm::normalize(eta * along - std::sqrt(k) * n);
  return true;
}

/// How light that comes along a ray has gone through a body.
struct Way {
  bool met = false, leaves = true;
  double inside = 0;  ///< length of its way in the body
  double cosine = 1;  ///< of the angle at which it enters
  dvec3 direction{0};
};

Way through_glass(const Convex& body, dvec3 origin, dvec3 d, double index, bool starts_inside, Shake& shake) {
  Way way;
  double t;
  dvec3 n;
  way.direction = d;
  if (!starts_inside) {
    if (!body.meet(origin, d, true, t, n)) return way;
    way.met = true;
    way.cosine = -glm::dot(d, n);
    origin += t * d + shake();
    if (!bent(shake.turned(d), n, 1 / index, d)) {
      way.direction = mirrored(d, n);
      return way;
    }
  }
  way.met = true;
  for (int bounce = 0; bounce < most_depth - 1; ++bounce) {
    if (!body.meet(origin, d, false, t, n)) break;
    way.inside += t;
    origin += t * d + shake();
    d = shake.turned(d);
    if (bent(d, -n, index, way.direction)) return way;
    d = mirrored(d, n);
  }
  way.leaves = false;
  return way;
}

Way off_mirror(const Convex& body, const dvec3& origin, const dvec3& d, Shake& shake) {
  Way way;
  double t;
  dvec3 n;
  way.direction = d;
  way.met = body.meet(origin + shake(), d, true, t, n);
  if (way.met) way.direction = mirrored(d, n);
  return way;
}

/// What is wanted of a ray whose way is followed once as it is and sixteen times with points that are off.
/// `light` says what a way brings.
template <class Follow, class Light>
Wanted wanted_of(double most, std::uint64_t seed, bool directions, const Follow& follow, const Light& light) {
  Shake still{Random(1), 0}, shaken{Random(2, seed), most};
  const Way exact = follow(still);
  Wanted wanted;
  wanted.value = wanted.low = wanted.high = light(exact);
  if (directions && exact.leaves) wanted.direction = exact.direction;
  for (int k = 0; k < 16; ++k) {
    const Way other = follow(shaken);
    const dvec3 value = light(other);
    for (int c = 0; c < 3; ++c) {
      wanted.low[c] = std::min(wanted.low[c], value[c]);
      wanted.high[c] = std::max(wanted.high[c], value[c]);
    }
    wanted.angle = std::max(
        wanted.angle, other.leaves && exact.leaves ? angle_between(other.direction, exact.direction) : pi);
  }
  return wanted;
}

// ---- sizes and places --------------------------------------------------------

struct Place {
  std::string name;
  double size, distance;  ///< the distance from the origin in sizes
};
const std::vector<Place>& places() {
  static const std::vector<Place> all = {
      {"size 1e-6", 1e-6, 0}, {"size 1e-3", 1e-3, 0},     {"size 1", 1, 0},          {"size 1e3", 1e3, 0},
      {"size 1e6", 1e6, 0},   {"1e3 sizes away", 1, 1e3}, {"1e5 sizes away", 1, 1e5}};
  return all;
}

enum class BodyKind { icosphere, box, sphere };

Mesh box_mesh(const vec3& lower, const vec3& upper) {
  Mesh mesh;
  for (int k = 0; k < 8; ++k)
    mesh.positions.push_back({(k & 1) != 0 ? upper.x : lower.x, (k & 2) != 0 ? upper.y : lower.y,
                              (k & 4) != 0 ? upper.z : lower.z});
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  quad(0, 4, 6, 2), quad(1, 3, 7, 5), quad(0, 1, 5, 4), quad(2, 6, 7, 3), quad(0, 2, 3, 1), quad(4, 5, 7, 6);
  return mesh;
}

/// A body of one kind in a scene of its own, and its form in double.
struct Body {
  Scene scene;
  Convex form;
  double size, off;  ///< off: what a coordinate of a point of it may be off
};
Body make_body(BodyKind kind, const Place& place) {
  Body body;
  body.size = place.size;
  const dvec3 to = glm::normalize(dvec3(148376, 1234, -223423)) * (place.distance * place.size);
  const vec3 centre(to);
  if (kind == BodyKind::sphere) {
    body.scene.spheres.push_back({centre, static_cast<float>(place.size), 0});
    body.form.middle = dvec3(centre);
    body.form.radius = body.scene.spheres[0].radius;
  } else {
    const auto half = static_cast<float>(0.7 * place.size);
    body.scene.meshes.push_back(kind == BodyKind::icosphere ? icosphere(1, place.size, dvec3(centre))
                                                            : box_mesh(centre - half, centre + half));
    body.form = convex(body.scene.meshes[0], dvec3(centre));
  }
  body.off = 6 * u * (largest(dvec3(centre)) + place.size);
  body.scene.materials.resize(1);
  body.scene.materials[0].diffuse = vec3(0);
  return body;
}

/// side² rays from a point outside, over all of the body, or in all directions from its middle.
std::vector<Ray> rays_at(const Body& body, int side, bool from_inside) {
  const dvec3 back = glm::normalize(dvec3(0.31, 0.47, 0.83));
  const dvec3 right = glm::normalize(glm::cross(dvec3(0, 1, 0), back)), up = glm::cross(back, right);
  std::vector<Ray> rays;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const double sx = 2 * (x + 0.5) / side - 1, sy = 1 - 2 * (y + 0.5) / side;
      Ray ray;
      ray.origin = vec3(body.form.middle + (from_inside ? 0 : 4 * body.size) * back);
      const dvec3 target =
          from_inside ? (sx * 2) * right + (sy * 2) * up - back
                      : body.form.middle + body.size * 1.1 * (sx * right + sy * up) - dvec3(ray.origin);
      ray.direction = vec3(glm::normalize(target));
      ray.t_max = std::numeric_limits<float>::max();
      rays.push_back(ray);
    }
  return rays;
}

dvec3 origin_of(const Body& body, const Ray& ray) { return dvec3(ray.origin) - body.form.middle; }
dvec3 direction_of(const Ray& ray) { return glm::normalize(dvec3(ray.direction)); }

void finish_panel(Panel& panel) { finish(panel.scene, vec3(0, 1, 0), true); }

/// A matt body under a sun (red) and a lamp (green): from outside each point gets Lambert's cosine; from
/// inside, where nothing may come through, it is dark.
Panel shadow_panel(BodyKind kind, const Place& place, int side, bool from_inside) {
  Body body = make_body(kind, place);
  body.scene.materials[0].diffuse = vec3(1);
  Light sun;
  sun.kind = Light::Kind::directional;
  sun.direction = vec3(glm::normalize(dvec3(-0.6, -0.5, -0.4)));
  sun.intensity = {1, 0, 0};
  Light lamp;
  lamp.position = vec3(body.form.middle + body.size * dvec3(-0.9, 1.7, 2.2));
  lamp.intensity = {0, 1, 0};
  lamp.attenuation = {1, 0, 0};
  body.scene.lights = {sun, lamp};
  Panel panel{body.scene, rays_at(body, side, from_inside), {}};
  const dvec3 to_sun = -glm::normalize(dvec3(sun.direction)), at = dvec3(lamp.position) - body.form.middle;
  for (const Ray& ray : panel.rays) {
    const auto light = [&](const Way& way) { return way.direction; };
    const auto follow = [&](Shake& shake) {
      Way way;
      double t;
      dvec3 n;
      const dvec3 o = origin_of(body, ray) + shake(), d = direction_of(ray);
      if (!from_inside && body.form.meet(o, d, true, t, n))
        way.direction = {std::max(glm::dot(n, to_sun), 0.0),
                         std::max(glm::dot(n, glm::normalize(at - (o + t * d))), 0.0), 0};
      return way;
    };
    panel.wanted.push_back(wanted_of(body.off, panel.wanted.size(), false, follow, light));
    panel.wanted.back().angle = 0;
  }
  finish_panel(panel);
  return panel;
}

/// A mirror before a background of one: each ray brings one, from the direction that the law of reflection
/// says.
Panel mirror_panel(BodyKind kind, const Place& place, int side) {
  Body body = make_body(kind, place);
  body.scene.materials[0].reflection = vec3(1);
  body.scene.environment.colour = vec3(1);
  Panel panel{body.scene, rays_at(body, side, false), {}};
  for (const Ray& ray : panel.rays)
    panel.wanted.push_back(wanted_of(
        body.off, panel.wanted.size(), true,
        [&](Shake& shake) { return off_mirror(body.form, origin_of(body, ray), direction_of(ray), shake); },
        [](const Way&) { return dvec3(1); }));
  finish_panel(panel);
  return panel;
}

/// Glass that lets all red light through, and absorbs green and blue by the length of the way: before a
/// background of one each ray brings one of red, e^(−length) of the others.
Panel glass_panel(BodyKind kind, const Place& place, int side, bool from_inside, double index = 1.5) {
  Body body = make_body(kind, place);
  Material& glass = body.scene.materials[0];
  glass.transmission = vec3(1);
  glass.refraction_index = static_cast<float>(index);
  glass.absorption = vec3(0, 1 / place.size, 0.2 / place.size);
  body.scene.environment.colour = vec3(1);
  Panel panel{body.scene, rays_at(body, side, from_inside), {}};
  for (const Ray& ray : panel.rays)
    panel.wanted.push_back(wanted_of(
        body.off, panel.wanted.size(), true,
        [&](Shake& shake) {
          return through_glass(body.form, origin_of(body, ray), direction_of(ray),
                               double(glass.refraction_index), from_inside, shake);
        },
        [&](const Way& way) {
          return way.leaves ? dvec3(1, std::exp(-way.inside * double(glass.absorption.y)),
                                    std::exp(-way.inside * double(glass.absorption.z)))
                            : dvec3(0);
        }));
  finish_panel(panel);
  return panel;
}

// ---- glass, its angles and indices -------------------------------------------

Ray ray_from(const dvec3& origin, const dvec3& target) {
  Ray ray;
  ray.origin = vec3(origin);
  ray.direction = vec3(glm::normalize(target - dvec3(ray.origin)));
  ray.t_max = std::numeric_limits<float>::max();
  return ray;
}

/// A parallelogram of two triangles around a middle; its front is where a×b points.
Mesh parallelogram(const dvec3& middle, const dvec3& a, const dvec3& b, std::uint32_t material) {
  Mesh mesh;
  mesh.positions = {vec3(middle - a - b), vec3(middle + a - b), vec3(middle + a + b), vec3(middle - a + b)};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.materials = {material, material};
  return mesh;
}

/// Rays in glass of index 1.5 that meet its flat surface at the critical angle, a few hundred units in the
/// last place to either side. Beyond it lies light, behind them darkness: each brings what is let through.
Panel critical_panel(bool of_triangles, Fresnel mode, int side) {
  Panel panel;
  panel.scene.materials.resize(2);
  panel.scene.materials[0].diffuse = vec3(0);
  panel.scene.materials[0].transmission = vec3(1);
  panel.scene.materials[1].diffuse = vec3(0);
  panel.scene.environment.colour = vec3(1);
  panel.scene.planes = {{{0, 0, 1}, -1000, 1}};
  if (of_triangles)
    panel.scene.meshes.push_back(parallelogram(dvec3(0), {1000, 0, 0}, {0, 1000, 0}, 0));
  else
    panel.scene.planes.push_back({{0, 0, 1}, 0, 0});
  const double index = 1.5, eta = index;
  for (int i = 0; i < side * side; ++i) {
    const double sine = 1 / index * (1 + (i - side * side / 2) * 0.25 * u), azimuth = 0.37 * i;
    Ray ray;
    ray.origin = {0, 0, -1};
    ray.direction =
        vec3(sine * std::cos(azimuth), sine * std::sin(azimuth), std::sqrt((1 - sine) * (1 + sine)));
    ray.t_max = std::numeric_limits<float>::max();
    const dvec3 d = direction_of(ray);
    const double exact = 1 - eta * eta * (d.x * d.x + d.y * d.y);
    const auto through = [&](double k) {
      if (!(k >= 0)) return 0.0;
      const double cosine = std::sqrt(1 - (1 - k) / (eta * eta));
      return 1 - fresnel(mode, cosine, std::sqrt(k), eta);
    };
    panel.wanted.push_back(
        {dvec3(through(exact)), dvec3(through(exact - 24 * u)), dvec3(through(exact + 24 * u)), dvec3(0), 0});
    panel.rays.push_back(ray);
  }
  finish_panel(panel);
  return panel;
}

/// Two wide slabs of different glass, one on the other, that share the plane between them, or overlap there.
Panel stacked_panel(double overlap, int side) {
  Panel panel;
  panel.scene.meshes = {box_mesh({-50, -50, -1}, {50, 50, static_cast<float>(overlap)}),
                        box_mesh({-50, -50, 0}, {50, 50, 1})};
  panel.scene.materials.resize(2);
  const double indices[2] = {1.3, 1.7};
  for (std::uint32_t m = 0; m < 2; ++m) {
    panel.scene.meshes[m].materials.assign(12, m);
    Material& glass = panel.scene.materials[m];
    glass.diffuse = vec3(0);
    glass.transmission = vec3(1);
    glass.refraction_index = static_cast<float>(indices[m]);
    glass.absorption[m == 0 ? 1 : 2] = 0.5f;
  }
  panel.scene.environment.colour = vec3(1);
  for (int i = 0; i < side * side; ++i) {
    const double x = 2 * (i % side + 0.5) / side - 1, y = 2 * (i / side + 0.5) / side - 1;
    const Ray ray = ray_from({0.1, 0.2, 4}, {6 * x, 6 * y, 1});
    const dvec3 d = direction_of(ray);
    const double sine2 = d.x * d.x + d.y * d.y;
    double light[2];
    for (int m = 0; m < 2; ++m) {
      const double index = double(panel.scene.materials[m].refraction_index);
      // what was entered last, the lower slab, is what lies where both are
      const double height =
          m == 0 ? 1 + double(static_cast<float>(overlap)) : 1 - double(static_cast<float>(overlap));
      light[m] = std::exp(-0.5 * height / std::sqrt(1 - sine2 / (index * index)));
    }
    const dvec3 value(1, light[0], light[1]);
    panel.wanted.push_back({value, value, value, d, 0});
    panel.rays.push_back(ray);
  }
  finish_panel(panel);
  return panel;
}

/// Between two mirrors that also glow: Σ 0.97ⁱ·0.03, i = 0 … 64.
Panel hall_panel(int kind, int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  Material& mirror = panel.scene.materials[0];
  mirror.diffuse = vec3(0);
  mirror.reflection = vec3(0.97f);
  mirror.emission = vec3(0.03f);
  const dvec3 normal = kind == 2 ? glm::normalize(dvec3(0.3, -0.5, 0.7)) : dvec3(0, 0, 1);
  const dvec3 a = glm::normalize(glm::cross(normal, dvec3(0.2, 1, 0.1))), b = glm::cross(normal, a);
  if (kind == 0) {
    panel.scene.planes = {{{0, 0, 1}, 0, 0}, {{0, 0, -1}, -1, 0}};
  } else {
    panel.scene.meshes.push_back(parallelogram(dvec3(0), 100.0 * a, 100.0 * b, 0));
    panel.scene.meshes.push_back(parallelogram(normal, 100.0 * b, 100.0 * a, 0));
  }
  double sum = 0, part = 0.03f;
  for (int i = 0; i <= most_depth; ++i, part *= double(0.97f)) sum += part;
  for (int i = 0; i < side * side; ++i) {
    const double x = 2 * (i % side + 0.5) / side - 1, y = 2 * (i / side + 0.5) / side - 1;
    panel.rays.push_back(ray_from(0.4 * normal, 1.4 * normal + 0.4 * (x * a + y * b)));
    panel.wanted.push_back({dvec3(sum), dvec3(sum), dvec3(sum), dvec3(0), 0});
  }
  finish_panel(panel);
  return panel;
}

// ---- lamps at odd places -----------------------------------------------------

/// A lamp in the middle of a closed matt body: nothing outside is lit, all inside is.
Panel lamp_inside_panel(BodyKind kind, int side, bool from_inside) {
  Body body = make_body(kind, {"", 1, 0});
  body.scene.materials[0].diffuse = vec3(1);
  Light lamp;
  lamp.position = vec3(body.form.middle);
  lamp.attenuation = {1, 0, 0};
  body.scene.lights = {lamp};
  Panel panel{body.scene, rays_at(body, side, from_inside), {}};
  for (const Ray& ray : panel.rays)
    panel.wanted.push_back(wanted_of(
        body.off, panel.wanted.size(), false,
        [&](Shake& shake) {
          Way way;
          double t;
          dvec3 n;
          const dvec3 o = origin_of(body, ray) + shake(), d = direction_of(ray);
          if (from_inside && body.form.meet(o, d, false, t, n))
            way.direction = dvec3(glm::dot(n, glm::normalize(o + t * d)));
          return way;
        },
        [](const Way& way) { return way.direction; }));
  for (Wanted& wanted : panel.wanted) wanted.angle = 0;
  finish_panel(panel);
  return panel;
}

/// Two parallel squares, one unit apart, with a lamp exactly at a vertex of the lower one: the upper one gets
/// the cosine, the lower one nothing.
Panel lamp_on_surface_panel(bool seen_from_below, int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  panel.scene.materials[0].diffuse = vec3(1);
  const dvec3 normal = glm::normalize(dvec3(0.3, -0.5, 0.7)), middle(3.1, -2.3, 5.7);
  const dvec3 a = glm::normalize(glm::cross(normal, dvec3(0.2, 1, 0.1))), b = glm::cross(normal, a);
  Mesh floor;
  floor.positions = {vec3(middle), vec3(middle - 2.0 * a - 2.0 * b), vec3(middle + 2.0 * a - 2.0 * b),
                     vec3(middle + 2.0 * a + 2.0 * b), vec3(middle - 2.0 * a + 2.0 * b)};
  floor.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}};
  panel.scene.meshes = {floor, parallelogram(middle + normal, 2.0 * b, 2.0 * a, 0)};
  Light lamp;
  lamp.position = floor.positions[0];
  lamp.attenuation = {1, 0, 0};
  panel.scene.lights = {lamp};
  for (int i = 0; i < side * side; ++i) {
    const double x = 2 * (i % side + 0.5) / side - 1, y = 2 * (i / side + 0.5) / side - 1;
    const dvec3 across = 1.9 * (x * a + y * b);
    panel.rays.push_back(
        ray_from(middle + 0.5 * normal, middle + across + (seen_from_below ? 1.0 : 0.0) * normal));
    const dvec3 value(seen_from_below ? 1 / glm::length(across + normal) : 0.0);
    panel.wanted.push_back({value, value, value, dvec3(0), 0});
  }
  finish_panel(panel);
  return panel;
}

/// A lamp straight above what a ray meets, from 1e-3 down to nothing, whose light falls off with the square
/// of the distance: any light, as long as it is a number.
Panel lamp_near_panel(int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  panel.scene.materials[0].diffuse = vec3(1);
  panel.scene.materials[0].specular = vec3(1);
  panel.scene.materials[0].shininess = 20;
  panel.scene.meshes.push_back(parallelogram(dvec3(0), {3, 0, 0}, {0, 3, 0}, 0));
  for (int k = 0; k < 8; ++k) {
    Light lamp;
    lamp.position = {0.125f * float(k), 0, k < 7 ? std::pow(10.0f, -3.0f - 6.0f * float(k)) : 0.0f};
    panel.scene.lights.push_back(lamp);
  }
  for (int i = 0; i < side * side; ++i) {
    const auto k = static_cast<double>(i % 8);
    const double beside = i < side ? 0 : std::pow(10, -50.0 * i / (side * side));
    panel.rays.push_back(ray_from({0.125 * k + beside, 0, 1}, {0.125 * k + beside, 0, 0}));
    panel.wanted.push_back({dvec3(0), dvec3(0), dvec3(infinity), dvec3(0), 0});
  }
  finish_panel(panel);
  return panel;
}

/// A lamp 1e18 away is a sun.
Panel lamp_far_panel(BodyKind kind, int side) {
  Panel panel = shadow_panel(kind, {"", 1, 0}, side, false);
  Light& lamp = panel.scene.lights[1];
  lamp = panel.scene.lights[0];
  lamp.kind = Light::Kind::point;
  lamp.position = lamp.direction * -1e18f;
  lamp.intensity = {0, 1e36f, 0};
  lamp.attenuation = {0, 0, 1};
  for (Wanted& wanted : panel.wanted)
    wanted.value.y = wanted.value.x, wanted.low.y = wanted.low.x, wanted.high.y = wanted.high.x;
  finish_panel(panel);
  return panel;
}

// ---- odd triangles -----------------------------------------------------------

/// Normals of no length, or coordinates that are the same all over under maps of every kind: the surface is
/// lit as the bare triangles are.
Panel odd_attributes_panel(BodyKind kind, bool normals, int side) {
  Panel panel = shadow_panel(kind, {"", 1, 0}, side, false);
  Mesh& mesh = panel.scene.meshes[0];
  if (normals) {
    mesh.normals.assign(mesh.positions.size(), vec3(0));
  } else {
    mesh.texture_coordinates.assign(mesh.positions.size(), vec2(0.3f, 0.6f));
    const std::vector<u8vec4> white(4, u8vec4(255)), slope(4, u8vec4(220, 90, 230, 255));
    const std::vector<u8vec4> heights = {u8vec4(0, 0, 0, 255), u8vec4(255), u8vec4(255),
                                         u8vec4(0, 0, 0, 255)};
    panel.scene.textures = {make_texture("white", 2, 2, white, TextureUse::colour),
                            make_texture("slope", 2, 2, slope, TextureUse::data),
                            make_texture("heights", 2, 2, heights, TextureUse::data)};
    Material& material = panel.scene.materials[0];
    material.diffuse_map.texture = 0;
    material.normal_map.texture = 1;
    material.bump_map.texture = 2;
  }
  finish_panel(panel);
  return panel;
}

/// A slanting floor of triangles that are 10⁷ times as long as wide, under a sun: all of it is lit.
Panel sliver_floor_panel(int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  panel.scene.materials[0].diffuse = vec3(1);
  Mesh floor;
  constexpr std::uint32_t strips = 16;
  for (std::uint32_t i = 0; i <= strips; ++i) {
    const auto y = static_cast<float>((double(i) - strips / 2.0) * 1e-7);
    floor.positions.push_back({0, y, 0});
    floor.positions.push_back({1, y, 0.5f});
    if (i == strips) break;
    floor.triangles.push_back({2 * i, 2 * i + 1, 2 * i + 3});
    floor.triangles.push_back({2 * i, 2 * i + 3, 2 * i + 2});
  }
  panel.scene.meshes = {floor};
  Light sun;
  sun.kind = Light::Kind::directional;
  sun.direction = vec3(glm::normalize(dvec3(-0.2, -0.3, -0.9)));
  panel.scene.lights = {sun};
  const dvec3 normal = glm::normalize(dvec3(-0.5, 0, 1));
  const dvec3 value(-glm::dot(normal, dvec3(sun.direction)));
  for (int i = 0; i < side * side; ++i) {
    const double x = 0.02 + 0.96 * (i % side + 0.5) / side, y = 1.6 * ((i / side + 0.5) / side - 0.5);
    panel.rays.push_back(ray_from({0.4, 0, 2}, {x, y * 1e-6, x / 2}));
    panel.wanted.push_back({value, value, value, dvec3(0), 0});
  }
  finish_panel(panel);
  return panel;
}

/// Panes of glass whose two large faces have triangles 10⁷ times as long as wide at an edge; the rays go
/// through these, and just beside.
Panel sliver_glass_panel(int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  Material& glass = panel.scene.materials[0];
  glass.diffuse = vec3(0);
  glass.transmission = vec3(1);
  glass.absorption = vec3(0, 1, 0.2);
  panel.scene.environment.colour = vec3(1);
  Mesh pane = box_mesh({-1, 0, -0.5f}, {1, 2, 0.5f});
  pane.positions.push_back({0, 2e-7f, -0.5f});
  pane.positions.push_back({0, 2e-7f, 0.5f});
  pane.triangles.resize(8);  // all but the two large faces
  for (const std::uint32_t top : {0u, 1u}) {
    const std::uint32_t ring[4] = {0 + 4 * top, top ? 5u : 2u, 3 + 4 * top, top ? 6u : 1u};
    for (int k = 0; k < 4; ++k) pane.triangles.push_back({ring[k], ring[(k + 1) % 4], 8 + top});
  }
  const Convex form = convex(pane, dvec3(0));
  panel.scene.meshes = {pane};
  for (int i = 0; i < side * side; ++i) {
    const double x = 0.9 * (2 * (i % side + 0.5) / side - 1), y = 4e-7 * (i / side + 0.5) / side;
    panel.rays.push_back(ray_from({0.2, 1e-8, 3}, {x, y, 0.5}));
    const Ray& ray = panel.rays.back();
    panel.wanted.push_back(wanted_of(
        1e-12, panel.wanted.size(), true,
        [&](Shake& shake) {
          return through_glass(form, dvec3(ray.origin), direction_of(ray), double(glass.refraction_index),
                               false, shake);
        },
        [](const Way& way) {
          return way.leaves ? dvec3(1, std::exp(-way.inside), std::exp(-way.inside * double(0.2f)))
                            : dvec3(0);
        }));
  }
  finish_panel(panel);
  return panel;
}

/// A box of 1e-2 that stands on a floor of two triangles, so large, under a sun.
Panel contact_panel(double floor_size, int side) {
  Panel panel;
  panel.scene.materials.resize(1);
  panel.scene.materials[0].diffuse = vec3(1);
  const Mesh box = box_mesh({-0.005f, -0.005f, 0}, {0.005f, 0.005f, 0.01f});
  const Convex form = convex(box, dvec3(0));
  panel.scene.meshes = {box, parallelogram(dvec3(0), {floor_size / 2, 0, 0}, {0, floor_size / 2, 0}, 0)};
  Light sun;
  sun.kind = Light::Kind::directional;
  sun.direction = vec3(glm::normalize(dvec3(-0.5, -0.3, -0.8)));
  panel.scene.lights = {sun};
  const dvec3 to_sun = -glm::normalize(dvec3(sun.direction));
  for (int i = 0; i < side * side; ++i) {
    const double x = 0.03 * (2 * (i % side + 0.5) / side - 1), y = 0.03 * (1 - 2 * (i / side + 0.5) / side);
    panel.rays.push_back(ray_from({-0.03, -0.04, 0.06}, {x, y, 0}));
    const Ray& ray = panel.rays.back();
    panel.wanted.push_back(wanted_of(
        1e-6, panel.wanted.size(), false,
        [&](Shake& shake) {
          Way way;
          double t;
          dvec3 n;
          const dvec3 o = dvec3(ray.origin) + shake(), d = direction_of(ray);
          if (form.meet(o, d, true, t, n)) {
            way.direction = dvec3(std::max(glm::dot(n, to_sun), 0.0));
          } else {
            const dvec3 point = o - d * (o.z / d.z);
            const bool dark = form.meet(point + 1e-12 * to_sun, to_sun, true, t, n) ||
                              (std::fabs(point.x) < 0.005 && std::fabs(point.y) < 0.005);
            way.direction = dvec3(dark ? 0 : to_sun.z);
          }
          return way;
        },
        [](const Way& way) { return way.direction; }));
    panel.wanted.back().angle = 0;
  }
  finish_panel(panel);
  return panel;
}

// ---- who fails by nature -----------------------------------------------------

/// The cases whose names begin with these words, the technique, which part of the rays it fails at most, and
/// why.
struct Nature {
  std::vector<std::string> cases;
  std::vector<std::string> techniques;
  double most;
  const char* why;
};
const std::vector<Nature>& natures() {
  static const std::vector<Nature> all = {
      {{"shadows", "mirrors", "glass", "overlapping", "hall", "lamp", "normals", "degenerate", "sliver",
        "contact"},
       {"none"},
       1,
       "starts at the point as it is rounded, which lies on either side of the surface"},
      {{"shadows, size 1e-6", "glass, size 1e-6", "glass, size 1e-3", "glass, size 1"},
       {"fixed"},
       0.55,
       "moves by 5e-5, be the body that large or not"},
      {{"shadows, size 1e3", "mirrors, size 1e3", "glass, size 1e3", "shadows, size 1e6", "mirrors, size 1e6",
        "glass, size 1e6", "shadows, 1e3", "mirrors, 1e3", "glass, 1e3", "shadows, 1e5", "mirrors, 1e5",
        "glass, 1e5"},
       {"fixed"},
       0.65,
       "moves by 5e-5, which is less than the point may be off there"},
      {{"shadows, size 1e-6", "glass, size 1e-6", "glass, size 1e-3"},
       {"wachter-binder"},
       0.55,
       "moves by 2⁻¹⁶ near the origin, be the body that large or not"},
      {{"shadows, 1e5", "glass, 1e3", "glass, 1e5"},
       {"wachter-binder"},
       0.4,
       "moves by 256 floats, which far from the origin are a part of the body, or more than it"},
      {{"hall"},
       {"wachter-binder"},
       0.1,
       "moves by where the point lies, and not by how large the triangle is that it is worked out from"},
      {{"sliver glass"},
       {"fixed", "wachter-binder"},
       0.1,
       "of a sliver t may be off by more than the way that the ray is moved"},
      {{"contact shadow, floor 1e6"},
       {"fixed", "wachter-binder", "error-bound"},
       0.25,
       "u and v are floats: a triangle's point is known to 2⁻²⁴ of the triangle, here more than the body"},
      {{"glass, 1e3"},
       {"error-bound"},
       0.001,
       "floats are coarse there: near an edge the rounded point lies beyond the next face"},
      {{"shadows, 1e5", "glass, 1e5"},
       {"error-bound"},
       0.02,
       "floats are coarse there: near an edge the rounded point lies beyond the next face"},
      {{"triangle tests, 1e5", "kernels, 1e5"},
       {"plane", "moller-trumbore", "watertight", "split", "fused", "rt-gpu", "rt-gpu-jm", "rt-gpu-jm-ir"},
       0.02,
       "floats are coarse there: near an edge the rounded point lies beyond the next face"},
      {{"triangle tests, 1e5"},
       {"baldwin-weber"},
       0.1,
       "maps absolute coordinates: what their cancellation leaves is coarse against the triangle's borders"},
      {{"triangle tests, sliver"},
       {"plane", "moller-trumbore", "baldwin-weber"},
       0.5,
       "of a sliver it loses the digits that decide whether it is hit"},
      {{"coincident interfaces"},
       {"none", "fixed", "wachter-binder", "error-bound"},
       1,
       "two surfaces in one place: the ray meets one of them, and starts beyond the other"}};
  return all;
}
std::string why(const std::string& name, const std::string& technique, double part) {
  const auto begins = [&](const std::string& words) {
    if (name.compare(0, words.size(), words) != 0) return false;
    return name.size() == words.size() || name[words.size()] == ' ' || name[words.size()] == ',';
  };
  for (const Nature& nature : natures())
    if (std::any_of(nature.cases.begin(), nature.cases.end(), begins) && part <= nature.most &&
        std::find(nature.techniques.begin(), nature.techniques.end(), technique) != nature.techniques.end())
      return nature.why;
  return "";
}

constexpr BodyKind all_bodies[] = {BodyKind::icosphere, BodyKind::box, BodyKind::sphere};
constexpr BodyKind meshes[] = {BodyKind::icosphere, BodyKind::box};

}  // namespace

std::vector<std::string> reasons_of_whitted_techniques() {
  std::vector<std::string> reasons;
  for (const Nature& nature : natures()) reasons.emplace_back(nature.why);
  return reasons;
}

std::vector<StabilityCase> whitted_stability_cases(int side) {
  using Panels = std::vector<Panel>;
  std::vector<StabilityCase> cases;
  const auto add = [&](const std::string& case_name, const std::string& what, const std::string& unit,
                       const std::vector<Technique>& techniques, int columns,
                       const std::function<Panels(const WhittedSettings&)>& make) {
    cases.push_back({case_name, what, [=](const std::vector<Backend>& backends) {
                       std::vector<StabilityRow> rows;
                       std::map<Fresnel, Panels> made;  // what is wanted may depend on it
                       for (const Backend backend : backends)
                         for (const Technique& technique : techniques) {
                           WhittedSettings settings;
                           settings.terms.depth = most_depth;
                           settings.terms.least_contribution = 0;
                           settings.terms.fresnel = Fresnel::constant;
                           technique.set(settings);
                           const Fresnel mode = settings.terms.fresnel;
                           if (made.count(mode) == 0) made[mode] = make(settings);
                           StabilityRow row = judged_row(backend, made[mode], side, columns, settings, unit);
                           row.technique = technique.name;
                           if (row.failures > 0)
                             row.why = why(case_name, technique.name, double(row.failures) / double(row.of));
                           rows.push_back(std::move(row));
                         }
                       return rows;
                     }});
  };
  for (const Place& place : places()) {
    add("shadows, " + place.name, "convex bodies under lamps, from outside and from within", "light",
        offsets(), 3, [=](const WhittedSettings&) {
          Panels panels;
          for (const bool inside : {false, true})
            for (const BodyKind kind : all_bodies) panels.push_back(shadow_panel(kind, place, side, inside));
          return panels;
        });
    add("mirrors, " + place.name, "convex mirrors", "radians", offsets(), 3, [=](const WhittedSettings&) {
      Panels panels;
      for (const BodyKind kind : all_bodies) panels.push_back(mirror_panel(kind, place, side));
      return panels;
    });
    add("glass, " + place.name, "convex bodies of clear and of absorbing glass, from outside and from within",
        "radians", offsets(), 3, [=](const WhittedSettings&) {
          Panels panels;
          for (const bool inside : {false, true})
            for (const BodyKind kind : all_bodies) panels.push_back(glass_panel(kind, place, side, inside));
          return panels;
        });
  }
  add("coincident interfaces", "two slabs of glass that share a plane", "radians", offsets(), 1,
      [=](const WhittedSettings&) { return Panels{stacked_panel(0, side)}; });
  add("overlapping interfaces", "two slabs of glass, one reaching a hundredth into the other", "radians",
      offsets(), 1, [=](const WhittedSettings&) { return Panels{stacked_panel(0.01, side)}; });
  add("hall of mirrors, depth 64", "two glowing mirrors: unbounded planes, triangles, slanting triangles",
      "light", offsets(), 3, [=](const WhittedSettings&) {
        return Panels{hall_panel(0, side), hall_panel(1, side), hall_panel(2, side)};
      });
  add("lamp inside", "a lamp in the middle of a closed body, from outside and from within", "light",
      offsets(), 3, [=](const WhittedSettings&) {
        Panels panels;
        for (const bool inside : {false, true})
          for (const BodyKind kind : all_bodies) panels.push_back(lamp_inside_panel(kind, side, inside));
        return panels;
      });
  add("lamp on a surface", "a lamp at a floor's vertex: ceiling and floor", "light", offsets(), 2,
      [=](const WhittedSettings&) {
        return Panels{lamp_on_surface_panel(true, side), lamp_on_surface_panel(false, side)};
      });
  add("lamp at distance 0", "lamps at heights 1e-3 to 1e-39, and in the point itself", "light", offsets(), 1,
      [=](const WhittedSettings&) { return Panels{lamp_near_panel(side)}; });
  add("lamp at 1e18", "a lamp so far that squares of the distance are 1e36", "light", offsets(), 3,
      [=](const WhittedSettings&) {
        Panels panels;
        for (const BodyKind kind : all_bodies) panels.push_back(lamp_far_panel(kind, side));
        return panels;
      });
  add("normals of no length", "smooth meshes whose vertex normals are all zero", "light", offsets(), 2,
      [=](const WhittedSettings&) {
        return Panels{odd_attributes_panel(BodyKind::icosphere, true, side),
                      odd_attributes_panel(BodyKind::box, true, side)};
      });
  add("degenerate uv", "one texture coordinate all over, under colour, normal and bump maps", "light",
      offsets(), 2, [=](const WhittedSettings&) {
        return Panels{odd_attributes_panel(BodyKind::icosphere, false, side),
                      odd_attributes_panel(BodyKind::box, false, side)};
      });
  add("sliver floor", "a slanting floor of triangles 1e7 times as long as wide", "light", offsets(), 1,
      [=](const WhittedSettings&) { return Panels{sliver_floor_panel(side)}; });
  add("sliver glass", "a pane whose faces have such triangles", "radians", offsets(), 1,
      [=](const WhittedSettings&) { return Panels{sliver_glass_panel(side)}; });
  add("contact shadow, floor 1e3", "a box of 1e-2 on a floor of two triangles, 1e3 wide", "light", offsets(),
      1, [=](const WhittedSettings&) { return Panels{contact_panel(1e3, side)}; });
  add("contact shadow, floor 1e6", "a box of 1e-2 on a floor of two triangles, 1e6 wide", "light", offsets(),
      1, [=](const WhittedSettings&) { return Panels{contact_panel(1e6, side)}; });

  // the triangle tests of chapter 01, and the kernels, with rays that start where error bounds say
  for (const std::string name : {"size 1e-6", "size 1", "size 1e6", "1e5 sizes away"}) {
    const auto place =
        *std::find_if(places().begin(), places().end(), [&](const Place& p) { return p.name == name; });
    const auto both = [=](const WhittedSettings&) {
      Panels panels;
      for (const BodyKind kind : meshes) panels.push_back(shadow_panel(kind, place, side, false));
      for (const BodyKind kind : meshes) panels.push_back(shadow_panel(kind, place, side, true));
      for (const BodyKind kind : meshes) panels.push_back(glass_panel(kind, place, side, false));
      return panels;
    };
    add("triangle tests, " + name, "shadows and glass with each test", "light", tests(), 2, both);
    add("kernels, " + name, "shadows and glass with each kernel", "light", kernels(), 2, both);
  }
  add("triangle tests, sliver floor", "a slanting floor of triangles 1e7 times as long as wide", "light",
      tests(), 1, [=](const WhittedSettings&) { return Panels{sliver_floor_panel(side)}; });
  add("triangle tests, sliver glass", "a pane whose faces have such triangles", "radians", tests(), 1,
      [=](const WhittedSettings&) { return Panels{sliver_glass_panel(side)}; });

  // Fresnel's modes
  add("critical angle", "rays in glass at the critical angle, some hundred ulps to either side", "light",
      fresnel_modes(), 2, [=](const WhittedSettings& s) {
        return Panels{critical_panel(false, s.terms.fresnel, side),
                      critical_panel(true, s.terms.fresnel, side)};
      });
  const std::pair<const char*, double> indices[] = {
      {"index 1", 1}, {"index 1 - 1e-7", 1 - 1e-7}, {"index 1 + 1e-7", 1 + 1e-7}, {"index 100", 100}};
  for (const auto& [name, index] : indices)
    add(name, "convex bodies of clear glass with that index of refraction", "light", fresnel_modes(), 3,
        [=, index = index](const WhittedSettings& s) {
          Panels panels;
          for (const BodyKind kind : all_bodies) {
            panels.push_back(glass_panel(kind, {"", 1, 0}, side, false, index));
            if (s.terms.fresnel == Fresnel::constant) continue;
            // ways branch: all of them together bring one, but for what a mesh may hold for ever, at most
            // what it let in
            Panel& panel = panels.back();
            for (Material& material : panel.scene.materials) material.absorption = vec3(0);
            for (std::size_t i = 0; i < panel.rays.size(); ++i) {
              Shake still{Random(1), 0};
              const Body body = make_body(kind, {"", 1, 0});
              const Way way = through_glass(body.form, origin_of(body, panel.rays[i]),
                                            direction_of(panel.rays[i]), index, false, still);
              const double kept =
                  way.met && index == 100 ? 1 - fresnel(s.terms.fresnel, way.cosine, 1 / index) : 0;
              panel.wanted[i] = {dvec3(1), dvec3(1 - kept), dvec3(1), dvec3(0), 0};
            }
          }
          return panels;
        });
  return cases;
}

}  // namespace trilha
