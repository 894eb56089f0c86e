#pragma once
// What tests of readers share: how they look at a refusal, at warnings, and at what every mesh promises.

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "common/error.h"
#include "common/scene/scene.h"
#include "tests/testing.h"

namespace trilha::testing {

/// The message with which the call refuses its input; none where it takes it.
template <class Call>
std::optional<std::string> refusal(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return std::nullopt;
}

/// Is that a refusal in one line, of that file and line (0: of none), which says what would be right?
inline void check_refusal(const std::optional<std::string>& message, const std::string& path, int line,
                          const std::string& fragment) {
  REQUIRE(message);
  INFO(*message);
  CHECK(message->rfind(path + (line == 0 ? ": " : ":" + std::to_string(line) + ": "), 0) == 0);
  CHECK(message->find(fragment) != std::string::npos);
  CHECK(message->find(';') != std::string::npos);  // what would be right
  CHECK(message->find('\n') == std::string::npos);
}

inline bool warns_of(const Scene& scene, const std::string& fragment) {
  return std::any_of(scene.warnings.begin(), scene.warnings.end(), [&](const std::string& warning) {
    return warning.find(fragment) != std::string::npos && warning.find('\n') == std::string::npos;
  });
}

/// What every mesh promises, wherever it comes from.
inline bool sound(const Mesh& mesh) {
  const std::size_t n = mesh.positions.size();
  const auto finite = [](const vec3& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
  };
  const auto is_unit = [](const vec3& v) { return std::abs(glm::length(dvec3(v)) - 1) < 1e-6; };
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), finite) &&
         std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                     [n](const uvec3& t) { return t.x < n && t.y < n && t.z < n; }) &&
         (mesh.normals.empty() || mesh.normals.size() == n) &&
         std::all_of(mesh.normals.begin(), mesh.normals.end(), is_unit) &&
         (mesh.texture_coordinates.empty() || mesh.texture_coordinates.size() == n) &&
         (mesh.materials.empty() || mesh.materials.size() == mesh.triangles.size());
}

}  // namespace trilha::testing
