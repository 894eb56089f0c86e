// Moving a camera by hand, by what has to stay and what has to follow.

#include "common/app/camera_control.h"

#include <cmath>
#include <limits>

#include "chapters/01_ray_casting/ray_casting.h"
#include "tests/testing.h"

using namespace trilha;

namespace {

constexpr float no_number = std::numeric_limits<float>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

dvec3 any_direction(Random& random) {
  for (;;) {
    const dvec3 v(2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1,
                  2 * random.uniform_double() - 1);
    if (const double length = glm::length(v); length > 0.1 && length < 1) return v / length;
  }
}

/// Looks at something near the origin from that distance; the up vector is of any length.
Camera any_camera(Random& random, double distance, double off_origin = 0) {
  Camera camera;
  camera.target = vec3(off_origin * any_direction(random));
  camera.up = vec3(std::exp2(20 * random.uniform_double() - 10) * any_direction(random));
  do {
    camera.eye = vec3(dvec3(camera.target) + distance * any_direction(random));
  } while (std::fabs(glm::dot(glm::normalize(dvec3(camera.eye) - dvec3(camera.target)),
                              glm::normalize(dvec3(camera.up)))) > 0.99);
  camera.field_of_view = random.uniform(10, 120);
  return camera;
}

dvec3 view(const Camera& camera) { return dvec3(camera.target) - dvec3(camera.eye); }
double distance(const Camera& camera) { return glm::length(view(camera)); }
dvec3 right_of(const Camera& camera) {
  return glm::normalize(glm::cross(view(camera), dvec3(camera.up) / glm::length(dvec3(camera.up))));
}
double angle(const dvec3& a, const dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}
bool is_finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

const double sizes[] = {1e-6, 1, 1e6};

}  // namespace

// Catches: an orbit that spirals, or that turns by another angle or the other way; in scenes of any size, and
// from far away.
TEST_CASE("an orbit keeps its distance, and goes where it is told") {
  Random random(1);
  for (const double size : sizes)
    for (const double away : {1.0, 1e6})
      for (int turn = 0; turn < 200; ++turn) {
        const Camera before = any_camera(random, size * away, 0.5 * size);
        const double right = 0.2 * random.uniform_double() - 0.1, up = 0.02 * random.uniform_double() - 0.01;
        const Camera after = orbited(before, right, up);
        CHECK(distance(after) == Approx(distance(before)).epsilon(1e-6));
        CHECK(after.target == before.target);
        CHECK(after.up == before.up);
        const dvec3 pole = glm::normalize(dvec3(before.up));
        CHECK(angle(view(after), pole) - angle(view(before), pole) == Approx(up).margin(2e-6));
        const auto level = [&](const Camera& c) { return view(c) - glm::dot(view(c), pole) * pole; };
        CHECK(angle(level(before), level(after)) == Approx(std::fabs(right)).margin(1e-5));
        if (std::fabs(right) > 1e-3)
          CHECK((glm::dot(dvec3(after.eye) - dvec3(before.eye), right_of(before)) > 0) == (right > 0));
      }
  Camera camera = any_camera(random, 1);
  const double start = distance(camera);
  for (int turn = 0; turn < 10000; ++turn) camera = orbited(camera, 0.01, 0.01 * std::sin(0.01 * turn));
  CHECK(distance(camera) == Approx(start).epsilon(1e-4));  // rounding wanders, it does not run away
}

// Catches: a camera that goes over a pole, where left and right change places, or that is caught there.
TEST_CASE("no turn goes over a pole") {
  Random random(2);
  for (const double size : sizes)
    for (int turn = 0; turn < 100; ++turn) {
      const Camera start = any_camera(random, size);
      for (const auto& move : {orbited, turned})
        for (const double up : {0.3, -0.3, 100.0, -100.0}) {
          Camera camera = start;
          for (int i = 0; i < 20; ++i) {
            camera = move(camera, 0, up);
            const double from_pole = angle(view(camera), dvec3(camera.up));
            CHECK(from_pole > 0.9e-3);
            CHECK(from_pole < pi - 0.9e-3);
            CHECK(glm::dot(right_of(camera), right_of(start)) > 0.99);
          }
          PinholeCamera::make(camera, 4, 3);
          const Camera back = move(camera, 0, up > 0 ? -0.5 : 0.5);
          CHECK(angle(view(back), view(camera)) == Approx(0.5).epsilon(1e-3));
        }
    }
  for (const float side :
       {1.0f, -1.0f}) {  // nearer to a pole than a turn goes: it stays there, and comes back
    Camera beyond;
    beyond.eye = {0, side, 1e-4f};
    CHECK(angle(view(orbited(beyond, 0, side)), view(beyond)) < 1e-6);
    CHECK(angle(view(orbited(beyond, 0, -0.25 * side)), view(beyond)) == Approx(0.25).epsilon(1e-4));
  }
}

// Catches: a view that turns about something else than the eye, or the other way.
TEST_CASE("a turn about the eye keeps the eye") {
  Random random(3);
  for (const double size : sizes)
    for (int turn = 0; turn < 200; ++turn) {
      const Camera before = any_camera(random, size);
      const Camera to_right = turned(before, 0.1, 0), upwards = turned(before, 0, 0.01);
      CHECK((to_right.eye == before.eye && upwards.eye == before.eye));
      CHECK(distance(to_right) == Approx(distance(before)).epsilon(1e-6));
      CHECK(glm::dot(view(to_right), right_of(before)) > 0);
      const dvec3 pole = glm::normalize(dvec3(before.up));
      CHECK(angle(view(before), pole) - angle(view(upwards), pole) == Approx(0.01).margin(2e-6));
    }
}

// Catches: axes that are mixed up or have the wrong sign; a view that changes while the camera moves, where
// float is coarse as well.
TEST_CASE("a move goes along the camera's axes and leaves the view as it is") {
  Random random(4);
  for (const double size : sizes)
    for (int turn = 0; turn < 100; ++turn) {
      const Camera before = any_camera(random, size);
      const dvec3 forward = glm::normalize(view(before)), right = right_of(before);
      const double s = size / 8;
      const Camera after = moved(before, s, 2 * s, -3 * s);
      const dvec3 step = dvec3(after.eye) - dvec3(before.eye);
      CHECK(glm::dot(step, right) == Approx(s).epsilon(1e-5));
      CHECK(glm::dot(step, glm::cross(right, forward)) == Approx(2 * s).epsilon(1e-5));
      CHECK(glm::dot(step, forward) == Approx(-3 * s).epsilon(1e-5));
      CHECK(angle(view(after), view(before)) < 2e-6);
    }
  Camera far_off = any_camera(random, 1, 1e5);
  const dvec3 start = view(far_off);
  for (int i = 0; i < 1000; ++i) far_off = moved(far_off, 0.37, -0.11, 0);
  CHECK(angle(view(far_off), start) < 1e-2);  // float has steps of 1/128 there: eye and target take the same
}

// Catches: a pixel that is not where the chapters' rays put it: mirrored, off by half a pixel, with the
// aspect on the wrong side.
TEST_CASE("a point on a pinhole's ray is projected to the ray's pixel") {
  Random random(5);
  for (const double size : sizes)
    for (const auto& [width, height] : {std::pair{640, 480}, {100, 300}, {3840, 2160}})
      for (int turn = 0; turn < 100; ++turn) {
        const Camera camera = any_camera(random, size);
        const PinholeCamera pinhole = PinholeCamera::make(camera, width, height);
        const float x = random.uniform(), y = random.uniform();
        const Ray ray = pinhole.ray(x, y);
        const vec3 step = ray.direction * static_cast<float>(size * (0.5 + 4 * random.uniform_double()));
        const Projected p = projected(camera, width, height, ray.origin + step);
        CHECK(p.in_front);
        CHECK(p.x == Approx(x * width).margin(1e-5 * width / std::cos(1.2)));
        CHECK(p.y == Approx(y * height).margin(1e-5 * height / std::cos(1.2)));
        const Projected behind = projected(camera, width, height, ray.origin - step);
        CHECK((!behind.in_front && behind.x == 0 && behind.y == 0));
      }
}

// Catches: a drag that the scene does not follow.
TEST_CASE("what is at the target follows a drag") {
  Random random(6);
  for (const double size : sizes)
    for (int turn = 0; turn < 200; ++turn) {
      const Camera before = any_camera(random, size, size);
      const int width = 1280, height = 720;
      const double dx = 600 * random.uniform_double() - 300, dy = 600 * random.uniform_double() - 300;
      const Camera after = panned(before, dx, dy, height);
      const Projected p = projected(after, width, height, before.target);
      CHECK(std::fabs(p.x - (width / 2.0 + dx)) < 0.5);
      CHECK(std::fabs(p.y - (height / 2.0 + dy)) < 0.5);
    }
}

// Catches: a dolly that reaches the target or goes through it, that turns the view, or that leaves float's
// range.
TEST_CASE("a dolly changes the distance and never reaches the target") {
  Random random(7);
  for (const double size : sizes)
    for (const double off : {0.0, 1.0, 1e3})
      for (int turn = 0; turn < 50; ++turn) {
        const Camera before = any_camera(random, size, off * size);
        const Camera nearer = dollied(before, 0.8);
        CHECK(distance(nearer) == Approx(0.8 * distance(before)).epsilon(1e-6 + 1e-6 * off));
        CHECK(nearer.target == before.target);
        Camera in = before, out = before;
        for (int i = 0; i < 400; ++i) {
          in = dollied(in, 0.5);
          out = dollied(out, 2);
          REQUIRE(in.eye != in.target);
          REQUIRE(is_finite(out.eye));
        }
        CHECK(angle(view(in), view(before)) < 0.02);
        CHECK(angle(view(out), view(before)) < 1e-3);
        CHECK(distance(in) <= std::max(1e-29, 2e-4 * off * size));
        CHECK(distance(out) > 1e36);
        PinholeCamera::make(in, 4, 3);
        for (const double factor : {0.0, -1.0, double(no_number)}) {
          const Camera at_once = dollied(before, factor);
          CHECK(at_once.eye != at_once.target);
          CHECK(angle(view(at_once), view(before)) < 0.02);
        }
      }
}

// Catches: a view that looks elsewhere, or from elsewhere.
TEST_CASE("a focus looks at the point from where it is") {
  Random random(8);
  const Camera before = any_camera(random, 1);
  const vec3 point(any_direction(random));
  const Camera after = focused(before, point);
  CHECK((after.target == point && after.eye == before.eye && after.up == before.up));
  CHECK(focused(before, before.eye).target == before.target);
  const Camera along = focused(before, before.eye + before.up);  // straight up
  PinholeCamera::make(along, 4, 3);
}

// Catches: lines that are drawn where they are not, through what lies behind the eye; ends that no screen
// takes.
TEST_CASE("a line is cut where it passes the eye, and stays straight") {
  Random random(9);
  const int width = 800, height = 600;
  int cut = 0;
  for (const double size : sizes)
    for (int turn = 0; turn < 500; ++turn) {
      const Camera camera = any_camera(random, size);
      const auto point = [&] { return vec3(dvec3(camera.eye) + 2 * size * any_direction(random)); };
      const vec3 a = point(), b = point();
      const Projected at_a = projected(camera, width, height, a), at_b = projected(camera, width, height, b);
      const auto line = projected(camera, width, height, a, b);
      if (!at_a.in_front && !at_b.in_front) CHECK_FALSE(line.has_value());
      if (!line) continue;
      const auto& [x0, y0, x1, y1] = *line;
      for (const double x : {x0, x1}) CHECK(std::fabs(x - width / 2) <= 16.01 * width);
      for (const double y : {y0, y1}) CHECK(std::fabs(y - height / 2) <= 16.01 * height);
      const auto within = [&](const Projected& p) {
        return p.in_front && std::fabs(p.x - width / 2) < 15 * width &&
               std::fabs(p.y - height / 2) < 15 * height;
      };
      if (within(at_a)) CHECK(std::hypot(x0 - at_a.x, y0 - at_a.y) < 1e-6 * width);
      if (within(at_b)) CHECK(std::hypot(x1 - at_b.x, y1 - at_b.y) < 1e-6 * width);
      if (at_a.in_front == at_b.in_front || std::hypot(x1 - x0, y1 - y0) < 1) continue;
      ++cut;
      // a point of the line before the eye lies on the segment's line
      const vec3& seen = at_a.in_front ? a : b;
      const Projected p = projected(camera, width, height, seen);
      if (!within(p)) continue;
      const double off = (p.x - x0) * (y1 - y0) - (p.y - y0) * (x1 - x0);
      CHECK(std::fabs(off) / std::hypot(x1 - x0, y1 - y0) < 1e-3);
    }
  CHECK(cut > 100);

  const Camera camera = any_camera(random, 1);
  const vec3 out = PinholeCamera::make(camera, width, height).ray(0.25f, 0.75f).direction;
  const auto ray = projected(camera, width, height, camera.eye, camera.eye + 3.0f * out);
  REQUIRE(ray.has_value());  // a ray from the eye is a point
  CHECK(std::hypot((*ray)[0] - (*ray)[2], (*ray)[1] - (*ray)[3]) < 0.01);
  CHECK(std::hypot((*ray)[2] - 0.25 * width, (*ray)[3] - 0.75 * height) < 0.1);
}

// Catches: NaN from a camera that cannot be looked through, or from a hand that moves by what is no number.
TEST_CASE("what is hostile gives finite cameras, and one that can be looked through") {
  const float huge = 3e38f, tiny = std::numeric_limits<float>::denorm_min();
  Camera along, none, not_a_number, at_target, small, large;
  along.up = {0, 0, -2};
  none.up = vec3(0);
  not_a_number.up = vec3(no_number);
  at_target.eye = at_target.target = vec3(1);
  small = {vec3(tiny), vec3(0), vec3(tiny, 0, 0), 40};
  large = {vec3(huge), vec3(-huge), vec3(huge, 0, 0), 40};
  for (const Camera& camera : {along, none, not_a_number, at_target, small, large})
    for (const double a : {0.0, 0.5, 1e300, infinity, double(no_number)})
      for (const double b : {0.0, -0.5, -infinity})
        for (const Camera& result :
             {orbited(camera, a, b), turned(camera, a, b), moved(camera, a, b, a), panned(camera, a, b, 0),
              dollied(camera, a), dollied(camera, b), focused(camera, vec3(3)),
              focused(camera, vec3(static_cast<float>(a)))}) {
          CHECK(is_finite(result.eye));
          CHECK(is_finite(result.target));
          const Projected p = projected(camera, 640, 480, vec3(0.5f));
          CHECK((std::isfinite(p.x) && std::isfinite(p.y)));
          if (const auto line = projected(camera, 640, 480, vec3(0.5f), vec3(-huge)))
            for (const double x : *line) CHECK(std::isfinite(x));
        }
  for (const Camera& camera : {along, none, not_a_number})
    for (const Camera& result : {orbited(camera, 0.1, 0.1), turned(camera, 0.1, 0.1), moved(camera, 1, 0, 0),
                                 panned(camera, 1, 1, 480), dollied(camera, 0.5)})
      PinholeCamera::make(result, 4, 3);
  PinholeCamera::make(dollied(at_target, 2), 4, 3);
}
