#pragma once
// Moving a camera by hand. All of it is mathematics on a Camera: no window is needed.

#include <array>
#include <optional>

#include "common/scene/scene.h"

namespace trilha {

/// Turns the eye about the target: `right` and `up` are angles in radians, up to the poles of the scene's up
/// vector and never over them. The distance stays.
Camera orbited(const Camera& camera, double right, double up);

/// Turns the view about the eye, likewise.
Camera turned(const Camera& camera, double right, double up);

/// Moves eye and target: right, up and forward in the camera's frame, in units of length.
Camera moved(const Camera& camera, double right, double up, double forward);

/// Moves eye and target so that what is at the target follows a drag of dx, dy pixels in an image of that
/// height.
Camera panned(const Camera& camera, double dx, double dy, int height);

/// Moves the eye towards the target (factor below 1) or away: its distance times the factor, kept to what
/// float resolves at that distance from the origin.
Camera dollied(const Camera& camera, double factor);

/// Looks at the point from where it is.
Camera focused(const Camera& camera, const vec3& point);

/// Where a point of the scene is in a width × height image: x, y in pixels from the upper left, and whether it
/// lies before the eye. The inverse of the pinhole's rays.
struct Projected {
  double x, y;
  bool in_front;
};
Projected projected(const Camera& camera, int width, int height, const vec3& point);

/// The part of the line that lies in front of the eye, in pixels: {x₀, y₀, x₁, y₁}; nothing where none does.
std::optional<std::array<double, 4>> projected(const Camera& camera, int width, int height, const vec3& from,
                                               const vec3& to);

}  // namespace trilha
