#pragma once
// How structures are put on trial, in this chapter and in all that follow: the rays that a renderer sends,
// the time that a structure takes for them with what it visits, its answers against brute force, and the
// error of a picture over the time that it takes to build and to render.

#include <map>

#include "chapters/01_ray_casting/ray_casting.h"
#include "common/report/report.h"
#include "common/report/stability.h"
#include "common/scene/scene.h"

namespace trilha {

/// A structure on trial.
struct Contender {
  std::string technique;
  std::map<std::string, SettingValue> settings;
  MakeStructure make;
};

/// Primary: through the pixels' centres. Bounce: from each hit, distributed as the cosine about the geometric
/// normal on the viewer's side. Shadow: from each hit to a light.
enum class RayKind { primary, bounce, shadow };
constexpr RayKind all_ray_kinds[] = {RayKind::primary, RayKind::bounce, RayKind::shadow};
inline const char* name(RayKind kind) {
  constexpr const char* names[] = {"primary", "bounce", "shadow"};
  return names[static_cast<int>(kind)];
}

/// A scene's triangles on a backend, and rays for them in the order of the image's 8×4-pixel tiles.
class TrialScene {
 public:
  /// The light of shadow rays is the scene's first that has a place, else one above and beside the eye. The
  /// structure that is made finds where rays start.
  TrialScene(const Scene& scene, const Stream& stream, const MakeStructure& make, int width, int height,
             std::uint64_t seed);

  const Stream& stream() const { return stream_; }
  TriangleArrays triangles() const {
    return {positions_.data(), triangles_.data(), static_cast<std::uint32_t>(triangles_.size())};
  }
  const Buffer<Ray>& rays(RayKind kind) const { return rays_[static_cast<int>(kind)]; }
  const std::string& name() const { return name_; }

 private:
  std::string name_;
  Stream stream_;
  Buffer<vec3> positions_;
  Buffer<uvec3> triangles_;
  Buffer<Ray> rays_[3];
};

/// How many of a structure's answers are not those of brute force, bit for bit.
struct Mismatches {
  std::uint64_t closest = 0, occluded = 0, of = 0;  ///< of: rays that were asked both
};
/// What brute force answers, by which structures of the same triangles are judged.
class Judge {
 public:
  /// Asks `most` of the rays at most, evenly chosen.
  Judge(const Stream& stream, const TriangleArrays& triangles, const Buffer<Ray>& rays, std::size_t most);
  Mismatches mismatches(const TriangleStructure& structure) const;

 private:
  Stream stream_;
  Buffer<Ray> rays_;
  std::vector<Hit> expected_;
};

/// Builds the contenders (the median of up to five builds), lets them take turns at the rays of each kind,
/// and adds a row for each: time, cells or nodes and triangles of all rays (of shadow rays, too, those that
/// the nearest hit takes, not any), mismatches with brute force among as many rays as make 10⁹ tests (10¹¹ on
/// a device). `part` of the experiment's time may pass. `finish` may add to a row what is known of its
/// structure.
using FinishRow = std::function<void(Row& row, const TriangleStructure& structure)>;
void try_contenders(Report& report, const TrialScene& scene, const std::vector<Contender>& contenders,
                    double part, const FinishRow& finish = {});

/// RMSE over build and render time while samples accumulate, a line a contender; pictures are chapter 01's.
void accumulate_contenders(Report& report, const Stream& stream, const Scene& scene,
                           const std::vector<Contender>& contenders, int width, int height, double seconds);
/// How that is drawn.
Experiment accumulation_experiment(double share, std::function<void(Report&)> run);

/// The stiff and extreme cases that all structures share: a failure is an answer that brute force does not
/// give.
std::vector<StabilityCase> structure_cases(const std::vector<Contender>& contenders, int width = 96,
                                           int height = 72);

}  // namespace trilha
