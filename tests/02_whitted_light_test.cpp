// The light that surfaces send back by Whitted's equation, against his formulas in double.
//
// What is known of rounding, for all cases below: u = 2⁻²⁴. A point that a ray meets is off by at most
// 8u·(Σ|coordinates|), along the surface (ray_triangle's t, surface_point.h), so directions from there over a
// distance d turn by 8u·Σ/d, besides 8u of their own (unit(): γ₄, and the ray's direction).

#include <cstdio>

#include "common/scene/made/solids.h"
#include "tests/whitted.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

constexpr double u = round_off;

/// Where the ray as it is meets the plane n·p = offset.
dvec3 meets(const Ray& ray, const dvec3& n, double offset) {
  const dvec3 o(ray.origin), d(ray.direction);
  return o + (offset - glm::dot(n, o)) / glm::dot(n, d) * d;
}

/// A floor of two triangles, or the plane y = 0.
Scene floor_of(const Material& material, bool plane) {
  Scene scene = scene_of({material});
  if (plane)
    scene.planes = {{{0, 1, 0}, 0, 0}};
  else
    add_parallelogram(scene, {-64, 0, -64}, {0, 0, 128}, {128, 0, 0}, 0);
  return scene;
}

dvec3 random_in(Random& random, const dvec3& low, const dvec3& high) {
  const double x = random.uniform_double(), y = random.uniform_double(), z = random.uniform_double();
  return low + (high - low) * dvec3(x, y, z);
}

}  // namespace

// ---- one lamp ----------------------------------------------------------------

// Catches: Lambert's cosine squared or forgotten, a mirrored instead of a half vector, an exponent that is
// applied to the wrong cosine, attenuation with a coefficient exchanged, of the squared distance or the wrong
// distance, a channel exchanged, ambient light that is shadowed or attenuated.
TEST_CASE("02: one lamp lights a floor as the formula says") {
  for (int k = 0; k < 24; ++k) {
    Random random(1, k);
    Material m;
    m.diffuse = random_colour(random);
    m.specular = random_colour(random);
    m.shininess = random.uniform(1, 120);
    Scene scene = floor_of(m, k % 2 == 1);
    scene.ambient = random_colour(random, 0, 0.3f);
    const vec3 fall = {random.uniform(), k % 3 ? random.uniform() : 0, k % 3 != 1 ? random.uniform() : 0};
    scene.lights = {
        lamp_at(vec3(random_in(random, {-5, 0.5, -5}, {5, 6, 5})), random_colour(random, 1, 9), fall)};
    std::vector<Ray> rays;
    for (int i = 0; i < 200; ++i) {
      const dvec3 eye = random_in(random, {-5, 0.5, -5}, {5, 6, 5}),
                  at = random_in(random, {-5, 0, -5}, {5, 0, 5});
      rays.push_back(ray_from(eye, at - eye));
    }
    with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
      const auto seen = colours_of(renderer, rays);
      double worst = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const dvec3 p = meets(rays[i], {0, 1, 0}, 0), to = dvec3(scene.lights[0].position) - p;
        const double d = glm::length(to), a = fall.x, b = fall.y, c = fall.z;
        const dvec3 l = to / d, half = l - glm::normalize(dvec3(rays[i].direction));
        const double cosine = l.y, peak = half.y / glm::length(half), s = m.shininess;
        const double falls = 1 / (a + b * d + c * d * d);
        // The direction to the lamp is off by `turn`, so the cosine by as much; the half vector by twice
        // that over its length before it is made unit, and pow multiplies relative errors with s. Distance
        // and its three coefficients: 2·turn; products, sums, the quotient and pow itself: 16u.
        const double size = sum_of_sizes(p) + sum_of_sizes(dvec3(rays[i].origin)) +
                            sum_of_sizes(dvec3(scene.lights[0].position));
        const double turn = 8 * u * size / d + 8 * u;
        const double shine = std::pow(peak, s);
        for (int ch = 0; ch < 3; ++ch) {
          const double light = scene.lights[0].intensity[ch] * falls;
          const double diffuse = light * m.diffuse[ch] * cosine, specular = light * m.specular[ch] * shine;
          const double expected = scene.ambient[ch] * m.diffuse[ch] + diffuse + specular;
          const double allowed = diffuse * turn / cosine +
                                 specular * s * 2 * turn / (peak * glm::length(half)) +
                                 (diffuse + specular) * 2 * turn + 16 * u * expected;
          worst = std::max(worst, std::fabs(seen[i][ch] - expected) / allowed);
          if (!(std::fabs(seen[i][ch] - expected) <= allowed))
            FAIL_CHECK("ray " << i << ": " << seen[i][ch] << ", not " << expected << " +- " << allowed);
        }
        if (seen[i].w != 2) FAIL_CHECK("a ray and its shadow ray are " << seen[i].w);
      }
      CHECK(worst < 1);
    });
  }
}

// Catches: a switch that switches another term, or none.
TEST_CASE("02: a term that is off is missing, and the others stay") {
  Material m;
  m.diffuse = {0.5f, 0.25f, 0.125f};
  m.specular = vec3(0.5f);
  m.shininess = 3;
  m.emission = {0.0625f, 0.125f, 0.25f};
  Scene scene = floor_of(m, true);
  scene.ambient = vec3(0.5f);
  scene.lights = {lamp_at({1, 2, 1}, vec3(8))};
  add_parallelogram(scene, {-9, 1, -9}, {9, 0, 0}, {0, 0, 9}, 0);  // shades all of x, z < 0
  std::vector<Ray> rays{ray_from({2, 3, 2}, {-1, -3, -1}), ray_from({-2, 0.5, -2}, {0.1, -1, 0.1})};
  with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer, WhittedSettings settings) {
    // what is lost by switching a term off is what is left when it is the only one
    const auto light = [&](const Terms& terms) {
      settings.terms = terms;
      WhittedRenderer other(scene, settings, renderer.stream());
      const auto seen = colours_of(other, rays);
      return std::vector<vec3>{vec3(seen[0]), vec3(seen[1])};
    };
    Terms all, none;
    none.ambient = none.emission = none.diffuse = none.specular = false;
    bool Terms::*const members[] = {&Terms::ambient, &Terms::emission, &Terms::diffuse, &Terms::specular};
    const auto whole = light(all);
    vec3 sums[2] = {vec3(0), vec3(0)};
    for (bool Terms::*member : members) {
      Terms one = none, without = all;
      one.*member = true;
      without.*member = false;
      const auto alone = light(one), rest = light(without);
      for (int r = 0; r < 2; ++r) {
        sums[r] += alone[r];
        for (int c = 0; c < 3; ++c) CHECK(alone[r][c] + rest[r][c] == Approx(whole[r][c]).epsilon(8 * u));
      }
      CHECK(alone[0].x > 0);  // every term lights the first ray's point,
    }
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 3; ++c) CHECK(sums[r][c] == Approx(whole[r][c]).epsilon(8 * u));
    // the second's is in the shade: only what needs no lamp is there, until shadows are off
    CHECK(whole[1] == m.emission + scene.ambient * m.diffuse);
    Terms no_shadows = all;
    no_shadows.shadows = false;
    CHECK(light(no_shadows)[1].x > whole[1].x + 0.01f);
    CHECK(light(no_shadows)[0] == whole[0]);
    Terms no_attenuation = none;
    no_attenuation.diffuse = true;
    no_attenuation.attenuation = false;
    const dvec3 p = meets(rays[0], {0, 1, 0}, 0);
    const double cosine = glm::normalize(dvec3(1, 2, 1) - p).y;
    CHECK(light(no_attenuation)[0].x == Approx(8 * 0.5 * cosine).epsilon(32 * u));
  });
}

// Catches: a cone of some hundredths of a degree that is rounded away or whose ramp has no digits, a step
// (both angles the same) that is none.
TEST_CASE("02: a narrow spot") {
  for (const double outer : {0.02, 0.05, 1.0, 60.0, 90.0})
    for (const double part : {0.0, 0.5, 1.0}) {
      INFO(outer << " degrees, the inner one " << part << " of it");
      Material m;
      m.diffuse = vec3(1);
      Scene scene = floor_of(m, true);
      Light light = lamp_at({0, 10, 0}, vec3(1), {1, 0, 0});
      light.kind = Light::Kind::spot;
      light.direction = {0, -1, 0};
      light.outer_angle = static_cast<float>(outer);
      light.inner_angle = static_cast<float>(outer * part);
      scene.lights = {light};
      std::vector<Ray> rays;
      std::vector<double> expected, allowed;
      for (const double share : {0.0, 0.3, 0.7, 0.9, 1.1}) {
        const double angle = share * outer * pi / 180;
        if (angle > 1.5) continue;
        const double x = 10 * std::tan(angle), cosine = std::cos(angle);
        rays.push_back(ray_from({x, 5, 0}, {0, -1, 0}));
        const auto opening = [](double degrees) { return 2 * std::pow(std::sin(degrees * pi / 360), 2); };
        const double width = opening(outer) - opening(outer * part);
        const double ramp = share > 1       ? 0
                            : share <= part ? 1
                                            : (opening(outer) - 2 * std::pow(std::sin(angle / 2), 2)) / width;
        expected.push_back(ramp * ramp * cosine);
        // |l + d|² is off by 4u|l + d|, and the ramp by that over its width
        const double apart = 2 * std::sin(angle / 2);
        allowed.push_back(width > 0 ? 8 * u + 2 * (4 * u * apart + 4 * u * u) / width + 64 * u : 64 * u);
      }
      with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
        const auto seen = colours_of(renderer, rays);
        for (std::size_t i = 0; i < rays.size(); ++i)
          if (!(std::fabs(seen[i].x - expected[i]) <= allowed[i]))
            FAIL_CHECK("ray " << i << ": " << seen[i].x << ", not " << expected[i] << " +- " << allowed[i]);
      });
    }
}

// Catches: a pixel that is the sum of finite samples and not finite, a lamp that shines in a colour that it
// does not have where its attenuation vanishes.
TEST_CASE("02: a lamp at no distance shines in its own colour, and no pixel is infinite") {
  Material m;
  m.diffuse = vec3(0.8f);
  Scene scene = floor_of(m, true);
  scene.lights = {lamp_at({0, 1e-25f, 0}, {1, 0, 0})};
  scene.camera.eye = {0, 1e-24f, 1e-25f};
  scene.camera.target = vec3(0);
  scene.features = features_of(scene);
  for (const Backend backend : backends())
    for (const Antialiasing method : all_antialiasing) {
      INFO(name(backend) << ", " << name(method));
      WhittedSettings settings;
      settings.antialiasing = method;
      WhittedRenderer renderer(scene, settings, backend);
      Film film(backend, 8, 8);
      for (std::uint32_t k = 0; k < 4; ++k)
        renderer.add_sample(film, scene.camera, k, 0, 1000, [](double) { return true; });
      bool bright = false;
      for (const vec3& pixel : film.image(backend).pixels) {
        REQUIRE((std::isfinite(pixel.x) && pixel.x >= 0));
        CHECK(pixel.y == 0);
        CHECK(pixel.z == 0);
        bright = bright || pixel.x > 1e30f;
      }
      CHECK(bright);
    }
}

// Catches: a cone of half its width, inner and outer exchanged, a ramp that is not squared, a sun with
// attenuation or a place, light beyond the range or none just within.
TEST_CASE("02: spots, suns and ranges") {
  Material m;
  m.diffuse = {1, 0.5f, 0.25f};
  for (int k = 0; k < 20; ++k) {
    Random random(2, k);
    Scene scene = floor_of(m, k % 2 == 1);
    Light light = lamp_at(vec3(random_in(random, {-3, 1, -3}, {3, 5, 3})), random_colour(random, 1, 9),
                          {0.5f, 0.25f, 0.125f});
    light.direction = vec3(glm::normalize(random_in(random, {-2, 0, -2}, {2, 0, 2}) - dvec3(light.position)));
    if (k % 3 == 0) {
      light.kind = Light::Kind::directional;
      light.range = 1e-3f;  // of a sun, nothing
    } else if (k % 3 == 1) {
      light.kind = Light::Kind::spot;
      light.outer_angle = random.uniform(10, 60);
      light.inner_angle = random.uniform(0, 0.9f) * light.outer_angle;
    } else {
      light.range = random.uniform(1.1f, 2) * light.position.y;
    }
    scene.lights = {light};
    std::vector<Ray> rays;
    for (int i = 0; i < 400; ++i) {
      const dvec3 eye = random_in(random, {-3, 1, -3}, {3, 5, 3});
      dvec3 at = random_in(random, {-4, 0, -4}, {4, 0, 4});
      if (k % 3 == 1 && i % 2) {  // about the spot's middle
        const dvec3 axis(light.direction),
            middle = dvec3(light.position) - axis * (light.position.y / axis.y);
        const double wide = 1.5 * light.position.y * std::tan(light.outer_angle * pi / 180);
        at = middle + wide * dvec3(random.uniform(-1, 1), 0, random.uniform(-1, 1));
      }
      rays.push_back(ray_from(eye, at - eye));
    }
    with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
      const auto seen = colours_of(renderer, rays);
      int lit = 0, dark = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const dvec3 p = meets(rays[i], {0, 1, 0}, 0), to = dvec3(light.position) - p;
        const double d = glm::length(to);
        const dvec3 l = light.kind == Light::Kind::directional ? -dvec3(light.direction) : to / d;
        const double size =
            sum_of_sizes(p) + sum_of_sizes(dvec3(rays[i].origin)) + sum_of_sizes(dvec3(light.position));
        const double turn = 8 * u * size / d + 8 * u;
        double share = 1, share_off = 0;
        if (light.kind != Light::Kind::directional) share /= 0.5 + 0.25 * d + 0.125 * d * d;
        if (light.kind == Light::Kind::spot) {
          const double outer = std::cos(light.outer_angle * pi / 180);
          const double inner = std::cos(light.inner_angle * pi / 180);
          const double ramp =
              std::clamp((-glm::dot(l, dvec3(light.direction)) - outer) / (inner - outer), 0.0, 1.0);
          // cosines are off by turn and two roundings; the ramp by that over its width
          const double ramp_off = (turn + 4 * u) / (inner - outer);
          share_off = share * (2 * ramp + ramp_off) * ramp_off;
          share *= ramp * ramp;
        }
        if (light.kind == Light::Kind::point && std::fabs(d - light.range) < 8 * u * size) continue;
        if (light.kind == Light::Kind::point && d > light.range) share = 0;
        (share > 0 ? lit : dark) += 1;
        for (int c = 0; c < 3; ++c) {
          const double expected = light.intensity[c] * m.diffuse[c] * share * l.y;
          const double allowed =
              expected * (turn / l.y + 2 * turn + 16 * u) + light.intensity[c] * m.diffuse[c] * share_off;
          if (!(std::fabs(seen[i][c] - expected) <= allowed))
            FAIL_CHECK("light " << k << ", ray " << i << ": " << seen[i][c] << ", not " << expected << " +- "
                                << allowed);
        }
      }
      CHECK(lit > 10);
      if (light.kind == Light::Kind::spot) CHECK(dark > 10);
    });
  }
}

// Catches: light that goes through what is opaque, a shadow in the wrong place, a lamp that a thing behind it
// shades.
TEST_CASE("02: the shadow of a ball ends where it should") {
  Material m;
  m.diffuse = vec3(1);
  for (int k = 0; k < 8; ++k) {
    Random random(3, k);
    Scene scene = floor_of(m, k % 2 == 1);
    scene.materials.push_back(black());
    const dvec3 lamp(vec3(random_in(random, {-1, 6, -1}, {1, 8, 1})));
    const dvec3 centre(vec3(random_in(random, {-1, 2, -1}, {1, 3, 1})));
    const float radius = random.uniform(0.3f, 0.8f);
    scene.spheres = {{vec3(centre), radius, 1}, {vec3(lamp) + vec3(0, 1.5f, 0), 1, 1}};
    scene.lights = {lamp_at(vec3(lamp), vec3(500))};
    with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
      // floor points on a line from the shadow's middle out
      const dvec3 axis = glm::normalize(centre - lamp);
      const dvec3 middle = lamp - axis * (lamp.y / axis.y);
      const dvec3 out = random_across(random, {0, 1, 0});
      // the ray looks from just above the floor, so that the ball is not in its way
      const double x = turning_point(renderer, 0, 6, [&](double s) {
        return ray_from(middle + out * s + dvec3(0, 0.25, 0), {0, -1, 0});
      });
      const dvec3 p = middle + out * x;
      // The shadow ray towards the lamp passes the ball's centre at a distance of its radius, off by its own
      // turn (8u, and 8u·Σ/d) over the way, and by the sphere's decision, 8u·r.
      const dvec3 l = glm::normalize(lamp - p);
      const double passes = glm::length(glm::cross(centre - p, l));
      const double size = sum_of_sizes(p) + sum_of_sizes(lamp) + sum_of_sizes(centre);
      CHECK(std::fabs(passes - radius) <= 8 * u * (3 * size + radius));
    });
  }
}

// Catches: light that ends at the triangles that face away from the lamp, not where the smooth surface does;
// light on what it does not reach.
TEST_CASE("02: a smooth ball's terminator is the ball's") {
  Material white;
  white.diffuse = vec3(1);
  Scene scene = scene_of({white});
  scene.meshes = {smooth_icosphere(2)};
  Light sun;
  sun.kind = Light::Kind::directional;
  sun.direction = vec3(glm::normalize(dvec3(-1, -0.5, 0.25)));
  sun.intensity = vec3(1);
  scene.lights = {sun};
  std::vector<Ray> rays;
  for (int i = 0; i < 4000; ++i) {
    Random random(6, i);
    const dvec3 n = random_direction(random);
    rays.push_back(ray_from(3.0 * n, -n));  // meets the ball where its normal is n, or nearly
  }
  for (const bool shadows : {true, false})
    for (const bool terminator : {true, false}) {
      WhittedSettings settings = whole_tree();
      settings.terms.shadows = shadows;
      settings.terms.terminator = terminator;
      with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
        const auto seen = colours_of(renderer, rays);
        int lit = 0, wrongly_dark = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          const double cosine = glm::dot(dvec3(rays[i].direction), dvec3(sun.direction));
          // The normals of the ball about the origin are its vertices, so interpolated they point along the
          // ray, wherever on the flat triangle that is: up to rounding, the cosine is the ball's.
          if (cosine < -64 * u) CHECK(seen[i].x == 0);
          if (cosine < 64 * u) continue;
          ++lit;
          if (seen[i].x == 0)
            ++wrongly_dark;
          else if (!(std::fabs(seen[i].x - cosine) < 64 * u))
            FAIL_CHECK("cosine " << cosine << ": " << seen[i].x);
        }
        INFO("shadows " << shadows << ", terminator " << terminator << ": " << wrongly_dark << " of " << lit
                        << " are dark");
        CHECK(lit > 1500);
        if (!shadows) CHECK(wrongly_dark == 0);
        if (shadows && terminator) CHECK(wrongly_dark < lit / 500);
        if (shadows && !terminator) CHECK(wrongly_dark > lit / 100);
      });
    }
}

// ---- mirrors -----------------------------------------------------------------

// Catches: a mirrored direction about another normal, a reflected ray that starts elsewhere, a picture that
// is not mirrored but turned.
TEST_CASE("02: a plane mirror shows a ball where its mirror image is") {
  for (int k = 0; k < 30; ++k) {
    Random random(4, k);
    const dvec3 n = dvec3(vec3(random_direction(random)));
    const float offset = random.uniform(-2, 2);
    const dvec3 unit_n = glm::normalize(n);
    const auto height = [&](const dvec3& p) { return (glm::dot(n, p) - offset) / glm::length(n); };
    Scene scene = scene_of({mirror(vec3(0.5f)), glowing(vec3(2))});
    if (k % 2) {
      scene.planes = {{vec3(n), offset, 0}};
    } else {
      const dvec3 s = random_across(random, unit_n), t = glm::cross(unit_n, s);
      add_parallelogram(scene, unit_n * double(offset) - 60.0 * s - 60.0 * t, 120.0 * s, 120.0 * t, 0);
    }
    const dvec3 a = random_across(random, unit_n), b = glm::cross(unit_n, a);
    const dvec3 on_plane = n * (offset / glm::dot(n, n));
    const dvec3 centre(
        vec3(on_plane + unit_n * double(random.uniform(1.5f, 4)) + a * double(random.uniform(-2, 2))));
    const dvec3 eye(vec3(on_plane + unit_n * double(random.uniform(0.5f, 4)) + a * 4.0 +
                         b * double(random.uniform(-2, 2))));
    const float radius = random.uniform(0.2f, 1);
    scene.spheres = {{vec3(centre), radius, 1}};
    const dvec3 image = centre - 2 * height(centre) * unit_n;
    with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
      // from the eye past the image at growing distance
      const dvec3 to = image - eye, aside = random_across(random, glm::normalize(to));
      const double x =
          turning_point(renderer, 0, 2 * radius, [&](double s) { return ray_from(eye, to + aside * s); });
      REQUIRE(x == x);
      const dvec3 d = glm::normalize(to + aside * x);
      const double passes = glm::length(glm::cross(to, d));
      // The eye's ray is rounded (2u), its point off along the mirror by 8u·Σ; the mirrored ray turns by
      // twice the normal's γ₄ and its own γ₆, and by twice of what the mirror itself is off where its corners
      // were rounded to floats of 64 (32u over 120 of length, both ways), all over the way that is left.
      const double way = glm::length(to), size = sum_of_sizes(eye) + sum_of_sizes(centre) + 60;
      const double allowed = (k % 2 ? 0 : 4 * 64 * u) + 8 * u * size + 24 * u * way;
      INFO("mirror " << k << ": " << passes - radius << " allowed " << allowed);
      CHECK(std::fabs(passes - radius) <= allowed);
      const auto seen = colours_of(renderer, {ray_from(eye, to)});
      CHECK(seen[0].x == 1);  // ½ of 2, without rounding
    });
  }
}

// Catches: a tree that ends a level early or late, an order that is counted twice or not at all, weights that
// are not multiplied, at any depth to 32 and at the last.
TEST_CASE("02: a hall of two mirrors is its geometric series, term by term") {
  const float k1 = 0.875f, k2 = 0.9375f, e1 = 0.5f, e2 = 0.25f;
  for (const bool planes : {false, true}) {
    Material first = mirror(vec3(k1, 1, 0.5f)), second = mirror(vec3(k2, 1, 0.5f));
    first.emission = vec3(e1);
    second.emission = vec3(e2);
    Scene scene = scene_of({first, second});
    if (planes) {
      scene.planes = {{{0, 0, 1}, -1, 0}, {{0, 0, -1}, -1, 1}};
    } else {
      add_parallelogram(scene, {-128, -128, -1}, {256, 0, 0}, {0, 256, 0}, 0);
      add_parallelogram(scene, {-128, -128, 1}, {0, 256, 0}, {256, 0, 0}, 1);
    }
    for (const dvec3& direction : {dvec3(0, 0, -1), dvec3(0.3, 0.1, -1), dvec3(0.9, -0.7, -1)}) {
      for (int depth = 0; depth <= 64; depth += depth < 33 ? 1 : 31) {
        WhittedSettings settings = whole_tree();
        settings.terms.depth = depth;
        with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
          const auto seen = colours_of(renderer, {ray_from({0.1, -0.2, 0.3}, direction)});
          for (int c = 0; c < 3; ++c) {
            const double r1 = first.reflection[c], r2 = second.reflection[c];
            double sum = 0, weight = 1;
            for (int order = 0; order <= depth; ++order) {
              sum += weight * (order % 2 ? e2 : e1);
              weight *= order % 2 ? r2 : r1;
            }
            // a weight is a product of `order` factors, a sum of so many terms; all are positive
            if (!(std::fabs(seen[0][c] - sum) <= 2 * (depth + 1) * u * sum))
              FAIL_CHECK("depth " << depth << ": " << seen[0][c] << ", not " << sum);
          }
          if (seen[0].w != float(depth + 1)) FAIL_CHECK("rays: " << seen[0].w);
        });
      }
    }
  }
}

// Catches: a branch that is followed though it counts too little, or cut though it counts enough.
TEST_CASE("02: the least contribution cuts where it says") {
  Scene scene = scene_of({mirror(vec3(0.5f))});
  scene.materials[0].emission = vec3(1);
  scene.planes = {{{0, 0, 1}, -1, 0}, {{0, 0, -1}, -1, 0}};
  for (const float least : {0.0f, 0.25f, 0.2499f, 0.2501f, 1e-3f, 1.0f}) {
    WhittedSettings settings = whole_tree();
    settings.terms.least_contribution = least;
    with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
      const float rays = colours_of(renderer, {ray_from({0, 0, 0}, {0, 0, 1})})[0].w;
      int expected = 1;  // the eye's own
      for (float weight = 0.5f; weight > least && expected <= most_depth; weight *= 0.5f) ++expected;
      CHECK(rays == float(expected));
    });
  }
}

// ---- a term alone ------------------------------------------------------------

// Catches: light that is made from nothing: a term that counts twice, a negative cosine that is not cut, a
// highlight behind a surface, a mirror that gives more than it gets.
TEST_CASE("02: a term alone never exceeds its closed form") {
  enum Alone { ambient, emission, diffuse, specular, reflection, transmission, all };
  for (int k = 0; k < 6 * all; ++k) {
    Random random(5, k);
    const auto alone = static_cast<Alone>(k % all);
    Scene scene = scene_of({});
    for (int m = 0; m < 4; ++m) {
      Material material;
      material.diffuse = random_colour(random);
      material.specular = random_colour(random);
      material.emission = random_colour(random);
      material.shininess = random.uniform(0, 50);
      material.reflection = random_colour(random, 0, 0.5f);
      if (m % 2) material.transmission = random_colour(random, 0, 0.5f);
      material.refraction_index = random.uniform(1, 2);
      scene.materials.push_back(material);
    }
    for (int i = 0; i < 5; ++i) {
      const dvec3 at = random_in(random, dvec3(-3), dvec3(3));
      if (i % 2)
        scene.spheres.push_back({vec3(at), random.uniform(0.2f, 1.5f), random.index(4)});
      else
        scene.meshes.push_back(box_mesh(at, at + random_in(random, dvec3(0.2), dvec3(2)), random.index(4)));
    }
    scene.planes = {{{0, 1, 0}, -3, random.index(4)}};
    // as the renderer numbers them: those of glass last
    std::stable_partition(scene.meshes.begin(), scene.meshes.end(),
                          [](const Mesh& mesh) { return mesh.materials[0] % 2 == 0; });
    std::stable_partition(scene.spheres.begin(), scene.spheres.end(),
                          [](const Sphere& sphere) { return sphere.material % 2 == 0; });
    for (int l = 0; l < 3; ++l)
      scene.lights.push_back(lamp_at(vec3(random_in(random, dvec3(-4), dvec3(4))),
                                     random_colour(random, 1, 9), {1, 0.5f, 0.25f}));
    scene.ambient = random_colour(random);
    scene.environment.colour = vec3(alone >= reflection ? 1 : 0);
    std::vector<Ray> rays;
    for (int i = 0; i < 300; ++i)
      rays.push_back(ray_from(random_in(random, dvec3(-6), dvec3(6)), random_direction(random)));
    WhittedSettings settings = whole_tree();
    Terms& t = settings.terms;
    t.ambient = alone == ambient, t.emission = alone == emission, t.diffuse = alone == diffuse;
    t.specular = alone == specular, t.reflection = alone == reflection,
    t.transmission = alone == transmission;
    t.coloured_shadows = false;  // so that no lamp is seen through glass
    t.depth = 12;
    with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
      const auto seen = colours_of(renderer, rays);
      int reached = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = renderer.trace(rays[i]);
        if (!hit.found()) {
          if (vec3(seen[i]) != scene.environment.colour) FAIL_CHECK("nothing is met, and yet there is light");
          continue;
        }
        const ShadingView& view = renderer.scene().view();
        const dvec3 p = dvec3(rays[i].origin) + double(hit.t) * dvec3(rays[i].direction);
        std::uint32_t m;
        dvec3 n;
        if (hit.primitive < view.triangle_count()) {
          std::uint32_t rest = hit.primitive;
          std::size_t mesh = 0;
          while (rest >= scene.meshes[mesh].triangles.size())
            rest -= std::uint32_t(scene.meshes[mesh++].triangles.size());
          const Mesh& of = scene.meshes[mesh];
          const uvec3 c = of.triangles[rest];
          const dvec3 a(of.positions[c.x]);
          n = glm::normalize(glm::cross(dvec3(of.positions[c.y]) - a, dvec3(of.positions[c.z]) - a));
          m = of.materials[rest];
        } else if (hit.primitive - view.triangle_count() < scene.spheres.size()) {
          const Sphere& s = scene.spheres[hit.primitive - view.triangle_count()];
          n = glm::normalize(p - dvec3(s.centre));
          m = s.material;
        } else {
          n = {0, 1, 0};
          m = scene.planes[0].material;
        }
        const bool back = glm::dot(n, dvec3(rays[i].direction)) > 0;
        if (back) n = -n;
        const Material& material = scene.materials[m];
        for (int c = 0; c < 3; ++c) {
          double most = 0, off = 0;
          if (alone == ambient) most = scene.ambient[c] * material.diffuse[c];
          if (alone == emission) most = material.emission[c];
          // from within, reflection may be total
          if (alone == reflection) most = material.reflection[c] + (back ? material.transmission[c] : 0);
          if (alone == transmission) most = material.transmission[c];
          if (alone == diffuse || alone == specular)
            for (const Light& light : scene.lights) {
              const dvec3 to = dvec3(light.position) - p;
              const double d = glm::length(to);
              const dvec3 l = to / d, half = glm::normalize(l - dvec3(rays[i].direction));
              const double arrives = light.intensity[c] / (1 + 0.5 * d + 0.25 * d * d);
              // as in the first case; t's own error moves p by 32u·Σ at these angles
              const double turn = 32 * u * (sum_of_sizes(p) + sum_of_sizes(dvec3(rays[i].origin)) + 12) / d;
              const double cosine = glm::dot(n, l);
              if (cosine < -turn) continue;
              const double shine =
                  alone == diffuse
                      ? material.diffuse[c] * std::max(cosine, 0.0)
                      : material.specular[c] * std::pow(std::max(glm::dot(n, half), 0.0), material.shininess);
              most += arrives * shine;
              off += arrives * turn * 2 * (alone == diffuse ? 1 : material.shininess + 2);
            }
          if (!(seen[i][c] <= most * (1 + 16 * u) + off))
            FAIL_CHECK("term " << alone << ", ray " << i << ": " << seen[i][c] << " exceeds " << most);
          if (seen[i][c] > 0.999 * most && most > 0) ++reached;
        }
      }
      // what passes a body meets two surfaces, so transmission alone never gives a whole k_t
      if (alone != transmission) CHECK(reached > 20);
    });
  }
}
