#include "common/scene/extreme.h"

#include <cmath>

#include "common/scene/made.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

bool finite(const vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

/// The case's name as one word of a command line: "size 1e-18, 1e5 sizes away" → "size_1e-18_1e5_sizes_away".
std::string word_of(const std::string& name) {
  std::string word;
  for (const char c : name) {
    if (c == ' ') word += '_';
    if (c != ' ' && c != ',') word += c;
  }
  return word;
}

/// Looks as the case's rays do, if they all start at one place within the box.
bool looks_from_inside(const ExtremeTrial& trial, const Box& box, Camera& camera) {
  const vec3 eye = trial.rays[1].origin;
  dvec3 sum(0);
  for (const Ray& ray : trial.rays) {
    if (!finite(ray.origin) || !finite(ray.direction)) continue;
    if (ray.origin != eye) return false;
    sum += glm::normalize(dvec3(ray.direction));
  }
  if (!(glm::all(glm::lessThan(box.lower, eye)) && glm::all(glm::lessThan(eye, box.upper)))) return false;
  // Rays that go everywhere show no picture from there.
  if (!(glm::length(sum) > 0.5 * static_cast<double>(trial.rays.size()))) return false;
  const double size = glm::length(dvec3(box.upper) - dvec3(box.lower));
  camera = {eye, vec3(dvec3(eye) + size * glm::normalize(sum)), {0, 1, 0}, 46};
  return true;
}

Scene make(const Parameters& parameters) {
  const ExtremeCase chosen = extreme_cases()[static_cast<std::size_t>(parameters.whole("case"))];
  ExtremeTrial trial = chosen.make(48, 48);
  Scene scene;
  scene.name = "extreme";
  scene.materials = {coloured("clay", {0.75f, 0.6f, 0.45f})};
  Box box;
  for (const vec3& position : trial.mesh.positions)
    if (finite(position)) box = united(box, position);
  if (!looks_from_inside(trial, box, scene.camera)) scene.camera = framing(box, {0, 1, 0});
  trial.mesh.name = chosen.name;
  scene.meshes.push_back(std::move(trial.mesh));
  scene.ambient = vec3(0.2f);
  Light sun;
  sun.name = "sun";
  sun.kind = Light::Kind::directional;  // which suits every size
  sun.direction = glm::normalize(vec3(-0.4f, -0.8f, -0.5f));
  scene.lights = {sun};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

/// The largest of the cases has as many.
MadeSize size(const Parameters&) { return {5120, 5120, 0, 0}; }

}  // namespace

std::vector<MadeScene> extreme_scenes() {
  std::vector<std::string> words;
  for (const ExtremeCase& each : extreme_cases()) words.push_back(word_of(each.name));
  const double last = static_cast<double>(words.size()) - 1;
  return {{"extreme",
           "the stiff and extreme cases that every structure is tested with: extreme:case=slivers",
           {{"case", "which; by name or number", 0, 0, last, true, std::move(words)}},
           make,
           size}};
}

}  // namespace trilha
