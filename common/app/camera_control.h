#pragma once
// Moving a camera by hand. All of it is mathematics on a Camera, in double: no window is needed.
//
// A camera that cannot be looked through is mended on the way: where its up vector is none, or points along
// the view, the axis that lies most across the view takes its place; where the eye is at the target, it looks
// along −z. Angles and distances that are no finite numbers count as 0. So finite cameras stay finite.

#include <array>
#include <optional>

#include "common/scene/scene.h"

namespace trilha {

/// Turns the eye about the target, by angles in radians: to the camera's right, and upwards to just before
/// the poles of the up vector, never over them. The distance stays, up to the rounding of the eye.
Camera orbited(const Camera& camera, double right, double up);

/// Turns the view about the eye, likewise.
Camera turned(const Camera& camera, double right, double up);

/// Moves eye and target: right, up and forward in the camera's frame, in units of length.
Camera moved(const Camera& camera, double right, double up, double forward);

/// Moves eye and target so that what is at the target follows a drag of dx, dy pixels (right, down) in an
/// image of that height.
Camera panned(const Camera& camera, double dx, double dy, int height);

/// Moves the eye towards the target (factor below 1) or away: its distance times the factor, kept to what
/// float resolves that far from the origin. A factor that is no number above 0 goes as near as that.
Camera dollied(const Camera& camera, double factor);

/// Looks at the point from where it is. A point that float cannot tell from the eye changes nothing.
Camera focused(const Camera& camera, const vec3& point);

/// Where a point of the scene is in a width × height image: x, y in pixels from the upper left, and whether
/// it lies before the eye; 0, 0 where it does not. The inverse of the pinhole's rays.
struct Projected {
  double x, y;
  bool in_front;
};
Projected projected(const Camera& camera, int width, int height, const vec3& point);

/// The part of the line that lies in front of the eye, in pixels: {x₀, y₀, x₁, y₁}; nothing where none does.
/// What is further from the middle of the image than 16 images is cut off: coordinates stay drawable.
std::optional<std::array<double, 4>> projected(const Camera& camera, int width, int height, const vec3& from,
                                               const vec3& to);

}  // namespace trilha
