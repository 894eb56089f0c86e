#include <algorithm>
#include <cfloat>
#include <cstdio>

#include "chapters/02_whitted/bodies.h"
#include "chapters/02_whitted/offsets.h"
#include "chapters/02_whitted/optics.h"
#include "common/math/random.h"
#include "common/math/statistics.h"
#include "tests/testing.h"

// References are in long double: 64 bits, which hold every product of two floats and the sums of some.

using namespace trilha;
using trilha::testing::effort;

namespace {

using L = long double;
using lvec3 = Vec3<L>;

constexpr double u = unit_roundoff<float>;
constexpr float infinity = std::numeric_limits<float>::infinity();
const float not_a_number = std::numeric_limits<float>::quiet_NaN();

L dot(const lvec3& a, const lvec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
L length(const lvec3& v) { return std::sqrt(dot(v, v)); }
lvec3 normalised(const lvec3& v) { return v / length(v); }

dvec3 random_unit(Random& random) {
  for (;;) {
    const dvec3 v = {2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1,
                     2 * random.uniform_double() - 1};
    const double square = glm::dot(v, v);
    if (square > 1e-4 && square <= 1) return v / std::sqrt(square);
  }
}
/// Rounded to floats, surely: GCC 12 drops the rounding where a vector of doubles becomes one of floats and
/// one of doubles again (its SLP vectoriser).
dvec3 rounded(const dvec3& v) {
  volatile float x = float(v.x), y = float(v.y), z = float(v.z);
  return {x, y, z};
}
/// From 10^low to 10^high, every power alike.
double random_size(Random& random, double low, double high) {
  return std::pow(10.0, low + (high - low) * random.uniform_double());
}
dvec3 across(Random& random, const dvec3& n) { return glm::normalize(glm::cross(n, random_unit(random))); }

constexpr float etas[] = {0.01f,        0.3f, 0.66666667f, 0.9999999f, 1.0f,  1.0000001f,
                          1.0f + 1e-4f, 1.5f, 2.0f,        10.0f,      100.0f};

/// cos² behind the surface, from vectors as they are.
L exact_cos2(const vec3& d, const vec3& n, float eta) {
  const lvec3 a(d), b(n), c = glm::cross(a, b);
  return 1 - L(eta) * eta * dot(c, c) / (dot(a, a) * dot(b, b));
}

}  // namespace

// ---- optics ------------------------------------------------------------------

// Catches: a mirror with the wrong sign or a factor that is not two; directions of other lengths than one.
TEST_CASE("a mirror keeps length and tangent, and turns the normal part") {
  for (std::size_t i = 0; i < 20000; ++i) {
    Random random(1, i);
    const vec3 n(random_unit(random)), d(random_unit(random) * random_size(random, -15, 15));
    const lvec3 r(reflected(d, n)), in(d), axis = normalised(lvec3(n));
    const lvec3 expected = in - 2 * dot(in, axis) * axis;
    if (!(length(r - expected) <= 12 * u * length(in))) FAIL_CHECK("direction " << i);
  }
}

// Catches: Snell with the ratio upside down, a normal of the wrong side, no renormalisation, cancellation for
// ratios near one.
TEST_CASE("refraction is Snell's, and leads back") {
  double worst_length = 0, worst = 0;
  int passed = 0, back_again = 0;
  for (std::size_t i = 0; i < 60000; ++i) {
    Random random(2, i);
    const float eta = etas[i % std::size(etas)];
    const dvec3 axis = random_unit(random);
    const double most = std::min(1.0, 1.0 / eta);
    const double sine = i % 3 ? most * random.uniform_double() : most * (1 - random_size(random, -6, 0));
    const vec3 n(axis), d(sine * across(random, axis) - std::sqrt(1 - sine * sine) * axis);
    const L k = exact_cos2(d, n, eta);
    vec3 out(7);
    if (!refracted(d, n, eta, out)) continue;
    ++passed;
    const lvec3 in = normalised(lvec3(d)), up = normalised(lvec3(n)), along = in - dot(in, up) * up;
    const lvec3 expected = L(eta) * along - std::sqrt(std::max(k, L(0))) * up;
    worst_length = std::max(worst_length, double(std::fabs(length(lvec3(out)) - 1)) / u);
    // k is off by 24u, its root by 12u/root; the rest by some u
    const double allowed =
        std::min(12 * u / double(std::sqrt(std::max(k, L(1e-30)))), std::sqrt(24 * u)) + 8 * u;
    const double off = double(length(lvec3(out) - expected));
    worst = std::max(worst, off / allowed);
    if (!(off <= allowed)) FAIL_CHECK("ratio " << eta << ", sine " << sine << ": off by " << off / u << "u");
    // back through the same surface: the error of the first way, times 1/eta and over the cosine again
    vec3 back(0);
    if (!refracted(-out, -n, 1 / eta, back)) continue;
    ++back_again;
    const double cosine = std::max(double(-dot(in, up)), 1e-4);
    if (!(double(length(lvec3(back) + lvec3(d))) <= (allowed + 16 * u) * std::max(1.0, 1.0 / eta) / cosine))
      FAIL_CHECK("ratio " << eta << ", sine " << sine << ": the way back is another");
  }
  std::printf("  length off by at most %.2fu, direction %.2f of its bound\n", worst_length, worst);
  CHECK(passed > 55000);
  CHECK(back_again > 50000);
  CHECK(worst_length <= 4);
}

// Catches: a surface between equal media that bends, reflects or stops light, at any angle, grazing included.
TEST_CASE("nothing happens between equal media") {
  for (std::size_t i = 0; i < 20000; ++i) {
    Random random(3, i);
    const dvec3 axis = random_unit(random);
    const double cosine = i % 2 ? random.uniform_double() : random_size(random, -12, 0);
    const vec3 n(axis), d(std::sqrt(1 - cosine * cosine) * across(random, axis) - cosine * axis);
    vec3 out(0);
    if (!refracted(d, n, 1.0f, out)) FAIL_CHECK("cosine " << cosine << ": total reflection");
    if (!(length(lvec3(out) - lvec3(d)) <= 8 * u)) FAIL_CHECK("cosine " << cosine << ": bent");
    for (const float c : {float(cosine), 0.0f, 1.0f})
      if (fresnel_exact(c, 1.0f) != 0 || fresnel(Fresnel::constant, c, 1.0f) != 0)
        FAIL_CHECK("cosine " << c << " reflects");
    // media that are all but equal: bent by at most tan(angle)·1e-7 or so, never NaN
    for (const float eta : {1 - 1e-7f, 1 + 1e-7f})
      if (refracted(d, n, eta, out)) {
        if (!(std::fabs(length(lvec3(out)) - 1) <= 4 * u)) FAIL_CHECK("not of length one");
        if (!(length(lvec3(out) - lvec3(d)) <= 3e-7 / std::max(cosine, 3e-4) + 8 * u))
          FAIL_CHECK("bent too far");
      }
  }
}

// Catches: 1 − eta²·sin² with cancellation, a cosine where the sine has the digits or the other way round.
TEST_CASE("at the critical angle plus and minus ulps the decision is right") {
  for (const float eta : {1.0000001f, 1 + 1e-6f, 1 + 1e-4f, 1.1f, 1.3f, 1.42f, 1.5f, 2.0f, 10.0f, 100.0f}) {
    double worst = 0;
    int total = 0, passed = 0, wrong = 0;
    for (std::size_t i = 0; i < 20000; ++i) {
      Random random(4, i);
      const dvec3 axis = random_unit(random);
      const double sine = std::min(1.0, 1.0 / eta * (1 + (random.uniform_double() - 0.5) * 128 * u));
      const vec3 n(axis), d(sine * across(random, axis) - std::sqrt(1 - sine * sine) * axis);
      if (glm::dot(dvec3(d), dvec3(n)) > 0) continue;
      vec3 out(0);
      const L k = exact_cos2(d, n, eta);
      const bool passes = refracted(d, n, eta, out);
      (passes ? passed : total) += 1;
      if (passes == (k >= 0)) continue;
      ++wrong;
      worst = std::max(worst, double(std::fabs(k)) / u);
    }
    std::printf("  ratio %-10.8g %5d pass, %5d reflect, %4d otherwise than exactly, at |k| <= %.2fu\n",
                double(eta), passed, total, wrong, worst);
    CHECK(worst <= 24);
    CHECK(passed > 1000);
    CHECK(total > 1000);
  }
}

// Catches: wrong formulas, shares that leave [0, 1], total reflection that loses light, Brewster's angle.
TEST_CASE("Fresnel's shares are those of the closed forms") {
  for (const float eta : etas) {
    const double e = eta, normal = (e - 1) * (e - 1) / ((e + 1) * (e + 1));
    INFO("ratio " << eta);
    CHECK(std::fabs(fresnel_exact(1.0f, eta) - normal) <= 8 * u * normal);
    CHECK(std::fabs(fresnel_schlick(1.0f, eta) - normal) <= 8 * u * normal);
    if (eta != 1) CHECK(fresnel_exact(0.0f, eta) >= 1 - 4 * u);
    double worst = 0;
    for (int i = 0; i <= 4000; ++i) {
      const float c = i < 2000 ? float(i) / 2000 : float(std::pow(10.0, -(i - 2000) / 100.0));
      const L k = 1 - L(eta) * eta * (1 - L(c)) * (1 + L(c));
      const float exact = fresnel_exact(c, eta), schlick = fresnel_schlick(c, eta);
      if (!(exact >= 0 && exact <= 1 && schlick >= 0 && schlick <= 1)) FAIL_CHECK("cosine " << c);
      if (fresnel(Fresnel::exact, c, eta) != exact || fresnel(Fresnel::schlick, c, eta) != schlick)
        FAIL_CHECK("another share by name, cosine " << c);
      if (k < -4 * u * eta * eta) {
        if (exact != 1 || schlick != 1 || fresnel(Fresnel::constant, c, eta) != 1)
          FAIL_CHECK("total reflection, cosine " << c << ", is not total");
        continue;
      }
      if (k < 4 * u * eta * eta) continue;  // either may be
      if (fresnel(Fresnel::constant, c, eta) != 0) FAIL_CHECK("constant");
      const L ct = std::sqrt(k), s = (eta * L(c) - ct) / (eta * L(c) + ct),
              p = (c - eta * ct) / (c + eta * ct);
      const L R = (s * s + p * p) / 2;
      // amplitudes of power: transmitted share from its own formulas, n₂cₜ/(n₁cᵢ)·t², so that R + T = 1
      const L ts = 2 * eta * L(c) / (eta * L(c) + ct), tp = 2 * eta * L(c) / (c + eta * ct);
      const L T = c > 0 ? ct / (eta * L(c)) * (ts * ts + tp * tp) / 2 : L(0);
      if (c > 0 && eta != 1 && !(std::fabs(exact + T - 1) <= 16 * u * (1 + eta * eta / k)))
        FAIL_CHECK("R + T = " << double(exact + T) << ", cosine " << c);
      worst = std::max(worst, double(std::fabs(exact - R) / (u * (1 + eta * eta / k))));
      const L r0 = (1 - L(eta)) * (1 - L(eta)) / ((1 + L(eta)) * (1 + L(eta)));
      const L x = 1 - (eta > 1 ? ct : L(c)), polynomial = r0 + (1 - r0) * x * x * x * x * x;
      if (!(std::fabs(schlick - polynomial) <= 16 * u * (1 + eta * eta / k)))
        FAIL_CHECK("Schlick, cosine " << c << ": " << schlick);
      // backwards the same share; 1/eta is rounded, and what counts of it is its difference from one
      const float back = fresnel_exact(float(ct), c, 1 / eta), there = fresnel_exact(c, float(ct), eta);
      if (!(std::fabs(back - there) <= 32 * u + 4 * u * there / std::max(std::fabs(1 - eta), FLT_MIN)))
        FAIL_CHECK("backwards another share, cosine " << c);
      const float schlick_back = fresnel_schlick(float(ct), c, 1 / eta);
      if (eta != 1 && !(std::fabs(schlick_back - fresnel_schlick(c, float(ct), eta)) <= 32 * u))
        FAIL_CHECK("backwards another Schlick, cosine " << c);
    }
    CHECK(worst <= 16);
    // Brewster: tan = n₂/n₁, where p vanishes and s² = ((1 − n²)/(1 + n²))²
    const double brewster = e / std::sqrt(1 + e * e), s = (1 - e * e) / (1 + e * e);
    const double behind = 1 / std::sqrt(1 + e * e);  // the cosine: the two angles make 90°
    CHECK(std::fabs(fresnel_exact(float(brewster), float(behind), eta) - s * s / 2) <= 32 * u);
  }
  // small contrast: the share has relative digits, where the textbook's form has none
  const double contrast = double(1.0000001f) - 1;
  CHECK(std::fabs(fresnel_exact(1.0f, 1.0000001f) / (contrast * contrast / 4) - 1) < 1e-5);
  CHECK(fresnel_exact(not_a_number, 1.5f) == 1);
}

// Catches: absorption without its sign, per metre squared, or with NaN where nothing meets infinity.
TEST_CASE("Beer and Lambert's law, with its ends") {
  CHECK(beer_lambert(vec3(0), infinity) == vec3(1));
  CHECK(beer_lambert(vec3(0), 1e18f) == vec3(1));
  CHECK(beer_lambert(vec3(0.5f, 0, infinity), infinity) == vec3(0, 1, 0));
  CHECK(beer_lambert(vec3(1, infinity, 0), 0.0f) == vec3(1));
  CHECK(beer_lambert(vec3(1e-18f), 1e30f) == vec3(0));
  for (int i = 0; i < 200; ++i) {
    Random random(5, i);
    const float a = random.uniform(0, 3), x = random.uniform(0, 3), y = random.uniform(0, 3);
    const double expected = std::exp(-double(a) * x);
    CHECK(std::fabs(beer_lambert(a, x) - expected) <= (4 + double(a) * x) * 2 * u * expected);
    CHECK(std::fabs(beer_lambert(a, x) * beer_lambert(a, y) - beer_lambert(a, x + y)) <= 40 * u);
  }
}

// ---- spheres -----------------------------------------------------------------

namespace {

struct SphereCase {
  Sphere sphere;
  RayOf<double> ray;  // all its numbers are floats
};

constexpr int sphere_kinds = 9;
const char* const sphere_kind[sphere_kinds] = {"from some radii away",   "from inside",
                                               "on the surface",         "grazing",
                                               "1e5 radii away",         "1e±18, any length of d",
                                               "at 1e5 radii from 0",    "radius 1e6, near by",
                                               "grazing, 1e5 radii away"};

SphereCase sphere_case(Random& random, int kind) {
  SphereCase c;
  double r = random_size(random, -1, 1), distance = random.uniform(1.0f, 8.0f) * r, d_size = 1, aside = 1.1;
  dvec3 centre = random_unit(random) * double(random.uniform(0, 4)) * r;
  if (kind == 1) distance = random.uniform() * r;
  if (kind == 2) distance = r;
  if (kind == 4 || kind == 8) distance = r * random_size(random, 3, 5);
  if (kind == 5) {
    r = random_size(random, -18, 18);
    centre = random_unit(random) * r * 3.0;
    distance = r * random_size(random, -3, 4);
    d_size = random_size(random, -18, 18);
  }
  if (kind == 6) centre = random_unit(random) * r * 1e5, distance = r * random.uniform(0.5f, 3);
  if (kind == 7) r = 1e6, centre = dvec3(0, -1e6, 0), distance = r + random.uniform(0, 10);
  c.sphere.centre = vec3(rounded(centre));
  c.sphere.radius = float(r);
  r = c.sphere.radius;
  const dvec3 out =
      kind == 7 ? glm::normalize(dvec3(0, 1, 0) + 1e-5 * random_unit(random)) : random_unit(random);
  const dvec3 origin = rounded(rounded(centre) + distance * out);
  if (kind == 3 || kind == 8) aside = 1 + (random.uniform_double() - 0.5) * random_size(random, -8, 0);
  dvec3 d = random_unit(random);
  if (kind != 1 && kind != 2 && kind != 7) {  // aimed at a point beside the centre
    const dvec3 target =
        rounded(centre) +
        across(random, out) * (r * aside * (kind == 3 || kind == 8 ? 1 : random.uniform_double()));
    d = glm::normalize(target - origin);
  }
  c.ray.origin = origin;
  c.ray.direction = rounded(d * d_size);
  return c;
}

struct Exact {
  L from, aside, half, near, far, d;  // distances; half the chord; t; |direction|
};
Exact exact_roots(const Sphere& sphere, const RayOf<double>& ray) {
  Exact e{};
  const L r = sphere.radius;
  const lvec3 d(ray.direction), f = lvec3(ray.origin) - lvec3(sphere.centre);
  e.d = length(d), e.from = length(f);
  const lvec3 way = d / e.d;
  const L middle = -dot(f, way);
  const lvec3 l = f + middle * way;
  e.aside = length(l);
  e.half = std::sqrt(std::max(r * r - dot(l, l), L(0)));
  const L c = dot(f, f) - r * r, q = middle + std::copysign(e.half, middle);
  e.near = (middle > 0 ? c / q : q) / e.d;
  e.far = (middle > 0 ? q : c / q) / e.d;
  return e;
}

/// What bodies.h promises of a root.
template <class T>
L promised(const Exact& e, L r) {
  const L v = unit_roundoff<T>, epsilon = 16 * v * r * r;
  return (16 * v * (e.from + r) + std::min(std::sqrt(epsilon), epsilon / std::max(e.half, LDBL_MIN))) / e.d +
         2 * std::numeric_limits<T>::denorm_min();
}

template <class T>
void check_spheres(std::size_t n) {
  const L v = unit_roundoff<T>;
  for (int kind = 0; kind < sphere_kinds; ++kind) {
    std::size_t hits = 0, misses = 0, unsure = 0;
    double worst_t = 0, worst_miss = 0;
    for (std::size_t i = 0; i < n; ++i) {
      Random random(6 + std::uint64_t(kind), i);
      const SphereCase c = sphere_case(random, kind);
      const Exact e = exact_roots(c.sphere, c.ray);
      const L r = c.sphere.radius;
      const Spheres<T> spheres{&c.sphere, 1, 10};
      RayOf<T> ray = c.ray.template as<T>();
      ray.t_min = -std::numeric_limits<T>::infinity();
      HitOf<T> near;
      spheres.intersect(0, ray, near);
      if (std::fabs(e.near) > FLT_MAX / 2 || std::fabs(e.far) > FLT_MAX / 2) continue;  // no t for it
      const bool exactly = e.aside <= r;
      if (near.found() != exactly) {
        ++unsure;
        worst_miss = std::max(worst_miss, double(std::fabs(e.aside - r) / (v * r)));
        continue;
      }
      (exactly ? hits : misses) += 1;
      if (!exactly) continue;
      if (near.primitive != 10 || near.u != 0 || near.v != 0) FAIL_CHECK("numbered " << near.primitive);
      ray.t_min =
          static_cast<T>(near.t + (std::fabs(near.t) * (4 * v) + std::numeric_limits<T>::denorm_min()));
      HitOf<T> far;
      spheres.intersect(0, ray, far);
      const L allowed = promised<T>(e, r);
      worst_t = std::max(worst_t, double(std::fabs(near.t - e.near) / allowed));
      if (far.found())
        worst_t = std::max(worst_t, double(std::fabs(far.t - e.far) / allowed));
      else if (!(e.far - e.near <= 2 * allowed))
        FAIL_CHECK(sphere_kind[kind] << ", " << i << ": no far side");
    }
    std::printf(
        "  %-24s %7zu hits, %7zu misses, %5zu otherwise, those aside by %.2fu; t at %.3f of its bound\n",
        sphere_kind[kind], hits, misses, unsure, worst_miss, worst_t);
    INFO(sphere_kind[kind]);
    CHECK(worst_t <= 1);
    CHECK(worst_miss <= 8);
    CHECK(hits > n / 4);
  }
}

}  // namespace

// Catches: the textbook's discriminant (cancels from afar), the unscaled one (overflows), c/q and q/a
// swapped, the far side forgotten, directions that must have length one.
TEST_CASE("spheres are hit where exact arithmetic says") {
  check_spheres<float>(effort(40000));
  check_spheres<double>(effort(10000));
}

// Catches: scaling left out because "it works without": it does, between 1e±9.
TEST_CASE("without scaling, spheres of extreme sizes are lost") {
  const auto found = [](float size, float d_size, bool scaled) {
    const Sphere sphere{vec3(0), size, 0};
    Ray ray;
    ray.origin = vec3(0.3f, 0.2f, -3) * size;
    ray.direction = vec3(0, 0, d_size);
    if (scaled) {
      Hit hit;
      Spheres<float>{&sphere, 1, 0}.intersect(0, ray, hit);
      return hit.found() && std::fabs(hit.t * d_size / size - (3 - std::sqrt(1 - 0.13f))) < 1e-5f;
    }
    Roots<float> t{};
    return sphere_roots(ray.origin, vec3(0), ray.direction, size, t) &&
           std::fabs(t.near * d_size / size - (3 - std::sqrt(1 - 0.13f))) < 1e-5f;
  };
  int lost = 0;
  for (const float size : {1e-18f, 1e-9f, 1.0f, 1e9f, 1e18f})
    for (const float d_size : {1e-18f, 1.0f, 1e18f}) {
      INFO("size " << size << ", |d| " << d_size);
      CHECK(found(size, d_size, true));
      lost += !found(size, d_size, false);
    }
  std::printf("  %d of 15 lost without scaling\n", lost);
  CHECK(found(1, 1, false));
  CHECK(lost >= 4);
}

// Catches: double roots lost or NaN, hits outside [t_min, t_max), ties that go to the second.
TEST_CASE("a sphere's ends: tangents, starts on it, t_min and t_max, ties, radius zero") {
  const Sphere one{vec3(0), 1, 0};
  const auto hit = [&](const vec3& o, const vec3& d, float t_min = 0, float t_max = infinity) {
    Ray ray;
    ray.origin = o, ray.direction = d, ray.t_min = t_min, ray.t_max = t_max;
    Hit h;
    h.t = t_max;
    Spheres<float>{&one, 1, 0}.intersect(0, ray, h);
    return h.found() ? h.t : -1;
  };
  CHECK(hit({0, 1, -4}, {0, 0, 1}) == 4);  // a double root
  CHECK(hit({0, 1, 0}, {0, 0, 1}) == 0);   // the same, from the point itself
  CHECK(hit({0, std::nextafter(1.0f, 2.0f), -4}, {0, 0, 1}) == -1);
  CHECK(hit({0, 0, -4}, {0, 0, 2}) == 1.5f);
  CHECK(hit({0, 0, -4}, {0, 0, 2}, 1.6f) == 2.5f);
  CHECK(hit({0, 0, -4}, {0, 0, 2}, 1.6f, 2.5f) == -1);
  CHECK(hit({0, 0, -4}, {0, 0, 2}, 2.6f) == -1);
  CHECK(hit({0, 0, 0}, {0, 0, 1}) == 1);
  CHECK(hit({0, 0, 1}, {0, 0, -1}, 1e-6f) == 2);
  CHECK(hit({0, 0, 4}, {0, 0, 1}) == -1);
  const Sphere twice[] = {{vec3(0), 0, 0}, one, one, {vec3(0), -1, 0}};
  Ray ray;
  ray.origin = {0, 0, -4};
  Hit h;
  const Spheres<float> spheres{twice, 4, 5};
  for (std::uint32_t i = 0; i < 4; ++i) spheres.intersect(i, ray, h);
  CHECK(h.primitive == 6);
  CHECK(h.t == 3);
  const Box box = spheres.bounds(1);
  CHECK(box.lower.x <= -1);
  CHECK(box.upper.z >= 1);
  CHECK(box.upper.z < 1.00001f);
}

// Catches: c = |from|² − r² with cancellation, which calls an origin just outside inside: the ray that leaves
// meets the sphere at once.
TEST_CASE("of an origin next to a sphere, the side is told to the last bit") {
  int outside = 0, inside = 0, wrong = 0;
  for (std::size_t i = 0; i < 40000; ++i) {
    Random random(15, i);
    const double r = random_size(random, -3, 3);
    const Sphere sphere{vec3(rounded(random_unit(random) * r)), float(r), 0};
    const dvec3 n = random_unit(random);
    Ray ray;
    ray.origin = vec3(dvec3(sphere.centre) + n * double(sphere.radius));
    ray.direction = vec3(random_unit(random));
    const lvec3 f = lvec3(ray.origin) - lvec3(sphere.centre);
    const L c = dot(f, f) - L(sphere.radius) * sphere.radius, fd = dot(f, lvec3(ray.direction));
    if (std::fabs(c) < 0x1p-44L * r * r || fd < 4 * u * r) continue;
    Hit hit;
    Spheres<float>{&sphere, 1, 0}.intersect(0, ray, hit);
    (c > 0 ? outside : inside) += 1;
    wrong += hit.found() != (c < 0);
  }
  CHECK(outside > 3000);
  CHECK(inside > 3000);
  CHECK(wrong == 0);
}

// ---- planes ------------------------------------------------------------------

// Catches: n·o − offset with cancellation, signs, parallel rays that hit, planes whose normal is not unit.
TEST_CASE("planes are hit where exact arithmetic says") {
  double worst = 0;
  std::size_t hits = 0;
  for (std::size_t i = 0; i < effort(100000); ++i) {
    Random random(20, i);
    const double size = random_size(random, -18, 18);
    Plane plane;
    plane.normal = vec3(random_unit(random));
    plane.offset = float(size * (i % 2 ? 1 : 1e5) * random.uniform_double());
    const dvec3 n(plane.normal), on = n * (double(plane.offset) / glm::dot(n, n)) + across(random, n) * size;
    Ray ray;
    ray.origin = vec3(on + (i % 3 ? size : 0.0) * random_unit(random));
    dvec3 d = random_unit(random);
    if (i % 5 == 0) d = across(random, n) + n * random_size(random, -7, 0);
    ray.direction = vec3(d * random_size(random, -15, 15));
    ray.t_min = -infinity;
    Hit hit;
    const Planes<float> planes{&plane, 1, 3};
    planes.intersect(0, ray, {}, hit);
    const lvec3 N(plane.normal), o(ray.origin), way(ray.direction);
    const auto terms = [&](const lvec3& x) {
      return std::fabs(N.x * x.x) + std::fabs(N.y * x.y) + std::fabs(N.z * x.z);
    };
    const L up = plane.offset - dot(N, o), down = dot(N, way), t = up / down,
            g = gamma<float>(4) * gamma<float>(4);
    const L down_error = g * terms(way);
    if (!(std::fabs(down) > 2 * down_error) || std::fabs(t) > FLT_MAX) continue;
    const L allowed =
        4 * u * std::fabs(t) +
        2 * (g * (terms(o) + std::fabs(plane.offset)) + std::fabs(t) * down_error) / std::fabs(down) +
        FLT_MIN;
    if (!hit.found() || hit.primitive != 3) {
      FAIL_CHECK("pair " << i << " missed at t " << double(t));
      continue;
    }
    ++hits;
    worst = std::max(worst, double(std::fabs(hit.t - t) / allowed));
  }
  std::printf("  %zu hits, t at %.3f of its bound\n", hits, worst);
  CHECK(worst <= 1);
  CHECK(hits > effort(100000) * 9 / 10);

  const Plane floor{vec3(0, 1, 0), 2, 0};
  const auto t = [&](const vec3& o, const vec3& d) {
    Ray ray;
    ray.origin = o, ray.direction = d;
    Hit hit;
    Planes<float>{&floor, 1, 0}.intersect(0, ray, hit);
    return hit.found() ? hit.t : -1;
  };
  CHECK(t({5, 6, 7}, {0, -2, 0}) == 2);
  CHECK(t({5, 6, 7}, {1, 0, 0}) == -1);
  CHECK(t({5, 2, 7}, {1, 0, 0}) == -1);  // in the plane
  CHECK(t({5, 2, 7}, {0, 1, 0}) == 0);
  CHECK(t({5, 6, 7}, {0, 1, 0}) == -1);
}

// ---- points and offsets ------------------------------------------------------

namespace {

/// How high above the true surface a point is, on the side of the outward normal, up to rounding of 2⁻⁶⁴.
struct Surface {
  enum Kind { sphere, plane, triangle } kind;
  Sphere ball;
  Plane flat;
  vec3 a, b, c;

  L height(const vec3& p) const {
    if (kind == sphere) {
      const lvec3 f = lvec3(p) - lvec3(ball.centre);
      const L r = ball.radius;
      return (dot(f, f) - r * r) / (length(f) + r);
    }
    if (kind == plane) {
      const lvec3 n(flat.normal);
      return (dot(n, lvec3(p)) - flat.offset) / length(n);
    }
    const lvec3 n = glm::cross(lvec3(b) - lvec3(a), lvec3(c) - lvec3(a));
    return dot(n, lvec3(p) - lvec3(a)) / length(n);
  }
  lvec3 normal(const vec3& p) const {
    if (kind == sphere) return normalised(lvec3(p) - lvec3(ball.centre));
    if (kind == plane) return normalised(lvec3(flat.normal));
    return normalised(glm::cross(lvec3(b) - lvec3(a), lvec3(c) - lvec3(a)));
  }
};

struct Placed {
  Surface surface;
  SurfacePoint at;
  double size;
};

/// A point on a surface of that kind; false where the made ray misses.
bool place(Random& random, Surface::Kind kind, double size, double away, double aspect, Placed& out) {
  dvec3 middle = random_unit(random) * size * away;
  if (random.index(3) == 0) middle = dvec3(0, away * size, 0);  // one coordinate worse than the others
  out.size = size;
  out.surface.kind = kind;
  Ray ray;
  const dvec3 way = random_unit(random);
  ray.direction = vec3(way * random_size(random, -3, 3));
  Hit hit;
  if (kind == Surface::sphere) {
    out.surface.ball = {vec3(middle), float(size), 0};
    ray.origin =
        vec3(rounded(middle) + size * (random_unit(random) * 0.7 - way * double(random.uniform(0, 50))));
    Spheres<float>{&out.surface.ball, 1, 0}.intersect(0, ray, hit);
    if (hit.found()) out.at = sphere_point(out.surface.ball, ray, hit.t);
  } else if (kind == Surface::plane) {
    const dvec3 n = random.index(4) ? random_unit(random) : dvec3(0, 1, 0);
    out.surface.flat = {vec3(n), float(glm::dot(rounded(n), middle)), 0};
    ray.origin = vec3(middle + size * random_unit(random) - way * size * double(random.uniform(0, 50)));
    Planes<float>{&out.surface.flat, 1, 0}.intersect(0, ray, {}, hit);
    if (hit.found()) out.at = plane_point(out.surface.flat, ray, hit.t);
    out.size = std::max(size, double(std::fabs(hit.t)) * glm::length(dvec3(ray.direction)));
  } else {
    const dvec3 long_side = random_unit(random), up = across(random, long_side);
    dvec3 p[3] = {middle, middle + long_side * size,
                  middle + long_side * size * double(random.uniform(-0.2f, 1.2f)) + up * (size / aspect)};
    const std::uint32_t turn = random.index(3);
    out.surface.a = vec3(p[turn]), out.surface.b = vec3(p[(turn + 1) % 3]),
    out.surface.c = vec3(p[(turn + 2) % 3]);
    float u0 = random.uniform(), v0 = random.uniform();
    if (u0 + v0 > 1) u0 = 1 - u0, v0 = 1 - v0;
    out.at = triangle_point(out.surface.a, out.surface.b, out.surface.c, u0, v0);
    const lvec3 n =
        glm::cross(lvec3(out.surface.b) - lvec3(out.surface.a), lvec3(out.surface.c) - lvec3(out.surface.a));
    return length(n) > size * size * 1e-9;  // of some area after its vertices were rounded
  }
  return hit.found();
}

const char* const surface_name[] = {"sphere", "plane", "triangle"};

struct Situation {
  double size_low, size_high, away, aspect;
};
constexpr Situation situations[] = {{0, 0, 1, 1},      {-18, 18, 1, 1}, {-18, 18, 1e3, 1},
                                    {-15, 15, 1e5, 1}, {-9, 9, 1, 1e4}, {-18, 18, 1, 1e7}};

}  // namespace

// Catches: an error bound that is not one, at any size and distance; or one that is no use because it is far
// too high; a normal that a sliver's rounded edges have turned.
TEST_CASE("a point's error bound holds, and is not wasteful") {
  for (const Situation& s : situations)
    for (const Surface::Kind kind : {Surface::sphere, Surface::plane, Surface::triangle}) {
      if (s.aspect > 1 && kind != Surface::triangle) continue;
      std::vector<double> wasted;
      double worst = 0, worst_normal = 0;
      const std::size_t n = effort(70000);  // × 14 = 10⁶
      for (std::size_t i = 0; i < n; ++i) {
        Random random(30 + std::uint64_t(kind), i);
        Placed p;
        if (!place(random, kind, random_size(random, s.size_low, s.size_high), s.away, s.aspect, p)) continue;
        const L height = p.surface.height(p.at.point);
        const lvec3 normal = p.surface.normal(p.at.point), e(p.at.error);
        const L bound = dot(glm::abs(normal), e), noise = 0x1p-60L * length(lvec3(p.at.point));
        if (!(std::fabs(height) <= bound + noise))
          FAIL_CHECK(surface_name[kind] << " " << i << ": off by " << double(height / bound)
                                        << " of its bound");
        worst = std::max(worst, double(std::fabs(height) / bound));
        worst_normal = std::max(worst_normal, double(length(lvec3(p.at.normal) - normal)) / u);
        if (height != 0) wasted.push_back(double(bound / std::fabs(height)));
      }
      std::sort(wasted.begin(), wasted.end());
      const double median = quantile(wasted, 0.5);
      std::printf(
          "  %-8s sizes 1e%+g…1e%+g, %g away, aspect %g: at most %.2f of the bound, the median 1/%.1f; "
          "normal %.2fu\n",
          surface_name[kind], s.size_low, s.size_high, s.away, s.aspect, worst, median, worst_normal);
      CHECK(wasted.size() > n / 8);
      CHECK(median < 50);
      if (kind != Surface::sphere)
        CHECK(worst_normal <= 12);
      else if (s.away <= 1)
        CHECK(worst_normal <= 400);  // what t moved the point sideways: u·distance/radius
    }
}

// Catches: an offset that leaves the point on the surface or behind it: no rounding away, the normal's own
// error forgotten, the surface's curvature forgotten on the inside.
TEST_CASE("moved by its error bound, a point is on the wanted side") {
  for (const Situation& s : situations)
    for (const Surface::Kind kind : {Surface::sphere, Surface::plane, Surface::triangle}) {
      if (s.aspect > 1 && kind != Surface::triangle) continue;
      double farthest = 0;
      std::size_t wrong = 0, unmoved_wrong = 0, seen = 0;
      for (std::size_t i = 0; i < effort(20000); ++i) {
        Random random(40 + std::uint64_t(kind), i);
        Placed p;
        if (!place(random, kind, random_size(random, s.size_low, s.size_high), s.away, s.aspect, p)) continue;
        for (const float sign : {1.0f, -1.0f}) {
          const vec3 side = p.at.normal * sign;
          const L height =
              sign * p.surface.height(offset_origin(SelfIntersection::error_bound, 0, p.at, side));
          wrong += !(height > 0);
          unmoved_wrong +=
              !(sign * p.surface.height(offset_origin(SelfIntersection::none, 0, p.at, side)) > 0);
          farthest = std::max(farthest, double(height / (u * (p.size + length(lvec3(p.at.point))))));
          ++seen;
        }
      }
      std::printf(
          "  %-8s sizes 1e%+g…1e%+g, %g away, aspect %g: %zu of %zu wrong (unmoved %zu), moved by at most "
          "%.1fu of size and position\n",
          surface_name[kind], s.size_low, s.size_high, s.away, s.aspect, wrong, seen, unmoved_wrong,
          farthest);
      INFO(surface_name[kind] << ", " << s.away << " away, aspect " << s.aspect);
      CHECK(wrong == 0);
      CHECK(unmoved_wrong > seen / 10);
      CHECK(farthest < 64);
    }
}

// Catches: a constant that passes for a method. 5e-5 is below one ulp at size 1e6, and 50 sizes at 1e-6.
TEST_CASE("a fixed length serves one scale, floats and error bounds more") {
  struct Row {
    double wrong[4] = {}, farthest[4] = {};
  };
  const auto row = [](double size) {
    Row r;
    int seen = 0;
    for (std::size_t i = 0; i < 6000; ++i) {
      Random random(50, i);
      Placed p;
      if (!place(random, Surface::triangle, size, 1, 1, p)) continue;
      ++seen;
      const vec3 side = p.at.normal * (i % 2 ? 1.0f : -1.0f);
      for (int m = 0; m < 4; ++m) {
        const vec3 o = offset_origin(SelfIntersection(m), 5e-5f, p.at, side);
        const L height = p.surface.height(o) * (i % 2 ? 1 : -1);
        r.wrong[m] += !(height > 0);
        r.farthest[m] = std::max(r.farthest[m], double(height) / size);
      }
    }
    for (double& w : r.wrong) w /= seen;
    std::printf(
        "  size %g: on the wrong side none %.4f, fixed %.4f, floats %.4f, bound %.4f; farthest, in sizes, "
        "%.2g %.2g %.2g %.2g\n",
        size, r.wrong[0], r.wrong[1], r.wrong[2], r.wrong[3], r.farthest[0], r.farthest[1], r.farthest[2],
        r.farthest[3]);
    return r;
  };
  const Row one = row(1), large = row(1e6), small = row(1e-6);
  const int fixed = int(SelfIntersection::fixed), floats = int(SelfIntersection::wachter_binder),
            bound = int(SelfIntersection::error_bound);
  CHECK(one.wrong[fixed] == 0);
  CHECK(large.wrong[fixed] > 0.05);    // too short: acne
  CHECK(small.farthest[fixed] > 10);   // too long: beyond the next surface
  CHECK(small.farthest[floats] > 10);  // its 2⁻¹⁶ near zero is a fixed length, too
  CHECK(one.wrong[floats] == 0);
  CHECK(large.wrong[floats] == 0);
  for (const Row* r : {&one, &large, &small}) {
    CHECK(r->wrong[bound] == 0);
    CHECK(r->farthest[bound] < 1e-5);
  }
}

// Catches: other constants than the published ones, the sign of negative coordinates.
TEST_CASE("Wächter and Binder's offset moves by 256 floats") {
  const auto moved = [](const vec3& p, const vec3& side) { return offset_by_floats(p, side); };
  CHECK(moved({1, 1, 1}, {1, 0, 0}) == vec3(1 + 256 * 0x1p-23f, 1, 1));
  CHECK(moved({-1, 1, 1}, {1, 0, 0}) == vec3(-1 + 256 * 0x1p-24f, 1, 1));
  CHECK(moved({8, 1, 1}, {-1, 0, 0}) == vec3(8 - 256 * 0x1p-21f, 1, 1));
  CHECK(moved({0, -0.01f, 1}, {0.6f, 0.8f, 0}) == vec3(0.6f / 65536, -0.01f + 0.8f / 65536, 1));
}

// Catches: a start that is on the right side, and a test that says otherwise: a sphere whose c loses its
// sign, a plane whose n·o − offset does.
TEST_CASE("a ray that leaves a sphere or a plane does not meet it again") {
  for (const Situation& s : situations)
    for (const Surface::Kind kind : {Surface::sphere, Surface::plane}) {
      if (s.aspect > 1) continue;
      std::size_t again = 0, lost = 0, seen = 0;
      for (std::size_t i = 0; i < effort(60000); ++i) {
        Random random(60 + std::uint64_t(kind), i);
        Placed p;
        if (!place(random, kind, random_size(random, s.size_low, s.size_high), s.away, 1, p)) continue;
        const dvec3 n(p.at.normal);
        const double cosine = i % 2 ? random.uniform_double() : random_size(random, -8, 0);
        const bool outside = i % 4 < 2 || kind == Surface::plane;
        const dvec3 way =
            across(random, n) * std::sqrt(1 - cosine * cosine) + n * (outside ? cosine : -cosine);
        Ray ray;
        ray.origin =
            offset_origin(SelfIntersection::error_bound, 0, p.at, p.at.normal * (outside ? 1.0f : -1.0f));
        ray.direction = vec3(way);
        if (!(dot(lvec3(ray.direction), p.surface.normal(ray.origin)) * (outside ? 1 : -1) > 0)) continue;
        Hit hit;
        if (kind == Surface::sphere)
          Spheres<float>{&p.surface.ball, 1, 0}.intersect(0, ray, hit);
        else
          Planes<float>{&p.surface.flat, 1, 0}.intersect(0, ray, {}, hit);
        ++seen;
        if (outside)
          again += hit.found();
        else
          lost += !hit.found();  // from within, the other side is there
      }
      std::printf("  %-8s sizes 1e%+g…1e%+g, %g away: of %zu rays %zu meet it again, %zu lose the far side\n",
                  surface_name[kind], s.size_low, s.size_high, s.away, seen, again, lost);
      CHECK(again == 0);
      CHECK(lost == 0);
    }
}

// Catches: the same for triangles, whose watertight test has a rounding error of its own.
TEST_CASE("a ray that leaves a triangle hardly meets it again") {
  for (const Situation& s : situations) {
    std::size_t again = 0, seen = 0, not_moved = 0;
    double farthest = 0;
    for (std::size_t i = 0; i < effort(60000); ++i) {
      Random random(70, i);
      Placed p;
      if (!place(random, Surface::triangle, random_size(random, s.size_low, s.size_high), s.away, s.aspect,
                 p))
        continue;
      const dvec3 n(p.at.normal);
      const double cosine = i % 2 ? random.uniform_double() : random_size(random, -8, 0);
      Ray ray;
      ray.direction = vec3(across(random, n) * std::sqrt(1 - cosine * cosine) + n * cosine);
      if (!(dot(lvec3(ray.direction), p.surface.normal(p.at.point)) > 0)) continue;
      const auto meets = [&](SelfIntersection method, Solution<float>& solution) {
        ray.origin = offset_origin(method, 0, p.at, p.at.normal);
        return intersect<Watertight>(p.surface.a, p.surface.b, p.surface.c, ray, solution);
      };
      Solution<float> solution{};
      ++seen;
      if (meets(SelfIntersection::error_bound, solution)) {
        ++again;
        farthest = std::max(farthest, double(solution.t) / p.size);
      }
      not_moved += meets(SelfIntersection::none, solution);
    }
    std::printf(
        "  sizes 1e%+g…1e%+g, %g away, aspect %g: of %zu rays %zu meet it again (unmoved %zu), at t <= %.2g "
        "sizes\n",
        s.size_low, s.size_high, s.away, s.aspect, seen, again, not_moved, farthest);
    CHECK(again <= seen / 1000);
  }
}

// Catches: NaN that becomes a hit, or a hit with a NaN in it; loops or traps on numbers that are none.
TEST_CASE("numbers that are none are missed") {
  const float bad[] = {not_a_number, infinity, -infinity, FLT_MAX, 0, 1e-45f, 1};
  Random random(80);
  const auto pick = [&] {
    return random.index(3) ? bad[random.index(std::size(bad))] : random.uniform(-2, 2);
  };
  int finite_hits = 0;
  for (int i = 0; i < 200000; ++i) {
    const Sphere sphere{{pick(), pick(), pick()}, pick(), 0};
    const Plane plane{{pick(), pick(), pick()}, pick(), 0};
    Ray ray;
    ray.origin = {pick(), pick(), pick()};
    ray.direction = {pick(), pick(), pick()};
    Hit a, b;
    Spheres<float>{&sphere, 1, 0}.intersect(0, ray, a);
    Planes<float>{&plane, 1, 0}.intersect(0, ray, {}, b);
    for (const Hit& hit : {a, b}) {
      if (hit.found() && !(hit.t >= 0 && hit.t < infinity)) FAIL_CHECK("t " << hit.t);
      finite_hits += hit.found();
    }
    vec3 out(0);
    const vec3 n(0, 1, 0);
    const vec3 d = glm::normalize(ray.direction);  // of length one, or NaN
    if (refracted(d, n, pick(), out) && !(std::fabs(glm::dot(out, out) - 1) < 1e-5f))
      FAIL_CHECK("refracted to " << out.x << " " << out.y << " " << out.z);
    const float share = fresnel(Fresnel(i % 3), pick(), pick());
    (void)share;
  }
  CHECK(finite_hits > 100);
  const SurfacePoint flat = triangle_point(vec3(1), vec3(2), vec3(3), 0.25f, 0.25f);  // of no area
  CHECK(flat.normal == vec3(0));
  CHECK(flat.point == vec3(1.75f));
  CHECK(offset_origin(SelfIntersection::error_bound, 0, flat, flat.normal) == flat.point);
}
