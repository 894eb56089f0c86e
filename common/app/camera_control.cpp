#include "common/app/camera_control.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trilha {
namespace {

/// How near to a pole a camera is turned: far enough for its right to be known to five digits.
constexpr double highest = pi / 2 - 1e-3;

/// Below this sine of the angle between view and up vector, the image has no up.
constexpr double least_sine = 1e-5;

constexpr double largest = 1e37;  // of what a camera is moved to: sums with it stay in float

double finite_or_zero(double x) { return std::isfinite(x) ? x : 0; }

/// The axes of a camera, of length one and across each other, but for `pole`, which up comes from.
struct Frame {
  dvec3 forward, right, up;
  dvec3 pole;
  double distance;  ///< of eye and target
  bool mended;      ///< the pole is not the camera's own
};

Frame frame_of(const Camera& camera) {
  Frame frame;
  const dvec3 view = dvec3(camera.target) - dvec3(camera.eye);
  frame.distance = glm::length(view);
  frame.forward = frame.distance > 0 ? view / frame.distance : dvec3(0, 0, -1);
  const dvec3 up(camera.up);
  const double length = glm::length(up);
  frame.pole = length > 0 && std::isfinite(length) ? up / length : frame.forward;
  dvec3 right = glm::cross(frame.forward, frame.pole);
  frame.mended = !(glm::length(right) > least_sine);
  if (frame.mended) {
    const dvec3 along = glm::abs(frame.forward);
    frame.pole = along.y <= along.x && along.y <= along.z ? dvec3(0, 1, 0)
                 : along.z <= along.x                     ? dvec3(0, 0, 1)
                                                          : dvec3(1, 0, 0);
    right = glm::cross(frame.forward, frame.pole);
  }
  frame.right = glm::normalize(right);
  frame.up = glm::cross(frame.right, frame.forward);
  return frame;
}

/// As float, but not beyond what is finite.
vec3 rounded(const dvec3& v) { return vec3(glm::clamp(v, dvec3(-largest), dvec3(largest))); }

Camera with_pole(Camera camera, const Frame& frame) {
  if (frame.mended) camera.up = vec3(frame.pole);
  return camera;
}

/// The direction turned about the pole, by `right` clockwise as seen from it, and towards it by `up`.
dvec3 turned(const dvec3& direction, const dvec3& pole, double right, double up) {
  const double height = std::clamp(glm::dot(direction, pole), -1.0, 1.0);
  const dvec3 level = glm::normalize(direction - height * pole);  // frame_of keeps it from the pole
  const dvec3 aside = glm::cross(level, pole);
  const double before = std::atan2(height, glm::length(direction - height * pole));
  // One that is beyond the highest already stays there; it only cannot go further.
  const double after = std::clamp(before + up, std::min(-highest, before), std::max(highest, before));
  const dvec3 round = std::cos(right) * level + std::sin(right) * aside;
  return glm::normalize(std::cos(after) * round + std::sin(after) * pole);
}

/// A point in the frame of the eye: right and down in half images at its depth, and its depth.
struct Seen {
  double x, y, depth;
};

/// The same times the depth: what is straight stays straight.
Seen seen(const Camera& camera, const Frame& frame, double aspect, const vec3& point) {
  const double tangent = std::tan(glm::radians(static_cast<double>(camera.field_of_view)) / 2);
  const dvec3 d = dvec3(point) - dvec3(camera.eye);
  return {glm::dot(d, frame.right) / (tangent * aspect), -glm::dot(d, frame.up) / tangent,
          glm::dot(d, frame.forward)};
}

}  // namespace

Camera orbited(const Camera& camera, double right, double up) {
  const Frame frame = frame_of(camera);
  Camera result = with_pole(camera, frame);
  // Seen from the target, what is to the camera's right is to the left.
  const dvec3 out = turned(-frame.forward, frame.pole, -finite_or_zero(right), finite_or_zero(up));
  result.eye = rounded(dvec3(camera.target) + frame.distance * out);
  return result;
}

Camera turned(const Camera& camera, double right, double up) {
  const Frame frame = frame_of(camera);
  Camera result = with_pole(camera, frame);
  const dvec3 forward = turned(frame.forward, frame.pole, finite_or_zero(right), finite_or_zero(up));
  result.target = rounded(dvec3(camera.eye) + frame.distance * forward);
  return result;
}

Camera moved(const Camera& camera, double right, double up, double forward) {
  const Frame frame = frame_of(camera);
  Camera result = with_pole(camera, frame);
  const dvec3 step = finite_or_zero(right) * frame.right + finite_or_zero(up) * frame.up +
                     finite_or_zero(forward) * frame.forward;
  result.eye = rounded(dvec3(camera.eye) + step);
  result.target = rounded(dvec3(camera.target) + step);
  return result;
}

Camera panned(const Camera& camera, double dx, double dy, int height) {
  const double half = std::tan(glm::radians(static_cast<double>(camera.field_of_view)) / 2);
  const double pixel = 2 * half * frame_of(camera).distance / std::max(height, 1);
  return moved(camera, -dx * pixel, dy * pixel, 0);
}

Camera dollied(const Camera& camera, double factor) {
  const Frame frame = frame_of(camera);
  Camera result = with_pole(camera, frame);
  const dvec3 target(camera.target);
  const double out = std::max({std::fabs(target.x), std::fabs(target.y), std::fabs(target.z)});
  // At 2⁻¹⁵ of the distance from the origin there are 256 floats or more between target and eye: enough for
  // the direction to be known to a quarter of a degree.
  const double nearest = std::max(out * 0x1p-15, 1e-30);
  // One that is as near as that stays: rounding it again and again would turn the view.
  if (!(factor > 1) && frame.distance > 0 && frame.distance <= 1.01 * nearest) return camera;
  const double wished = factor > 0 && frame.distance > 0 ? frame.distance * factor : 0;
  const double distance = std::clamp(wished, nearest, largest);
  result.eye = rounded(target - distance * frame.forward);
  return result;
}

Camera focused(const Camera& camera, const vec3& point) {
  if (point == camera.eye || !std::isfinite(glm::length(dvec3(point)))) return camera;
  Camera result = camera;
  result.target = point;
  return with_pole(result, frame_of(result));
}

Projected projected(const Camera& camera, int width, int height, const vec3& point) {
  const Seen p = seen(camera, frame_of(camera), double(width) / height, point);
  if (!(p.depth > 0)) return {0, 0, false};
  return {(p.x / p.depth + 1) / 2 * width, (p.y / p.depth + 1) / 2 * height, true};
}

std::optional<std::array<double, 4>> projected(const Camera& camera, int width, int height, const vec3& from,
                                               const vec3& to) {
  const Frame frame = frame_of(camera);
  const double aspect = double(width) / height;
  const Seen a = seen(camera, frame, aspect, from), b = seen(camera, frame, aspect, to);
  constexpr double images = 16 * 2;  // in half images
  const double least = 1e-9 * std::max(a.depth, b.depth);
  if (!(least > 0)) return std::nullopt;
  // How far inside each plane the ends are: before the eye, and within the images to each side.
  const auto inside = [&](const Seen& p) {
    return std::array{p.depth - least, images * p.depth - p.x, images * p.depth + p.x, images * p.depth - p.y,
                      images * p.depth + p.y};
  };
  const auto inside_a = inside(a), inside_b = inside(b);
  double begin = 0, end = 1;  // of the part that is left (Cyrus & Beck 1978)
  for (std::size_t i = 0; i < inside_a.size(); ++i) {
    // where both ends are outside, the cut lies beyond them, and nothing is left
    const double cut = inside_a[i] / (inside_a[i] - inside_b[i]);
    if (inside_a[i] < 0) begin = std::max(begin, cut);
    if (inside_b[i] < 0) end = std::min(end, cut);
  }
  if (!(begin <= end)) return std::nullopt;
  std::array<double, 4> result{};
  for (int i = 0; i < 2; ++i) {
    const double t = i == 0 ? begin : end;
    const double x = (1 - t) * a.x + t * b.x, y = (1 - t) * a.y + t * b.y;
    const double depth = std::max((1 - t) * a.depth + t * b.depth, least);
    result[2 * i] = (x / depth + 1) / 2 * width;
    result[2 * i + 1] = (y / depth + 1) / 2 * height;
    if (!std::isfinite(result[2 * i]) || !std::isfinite(result[2 * i + 1])) return std::nullopt;
  }
  return result;
}

}  // namespace trilha
