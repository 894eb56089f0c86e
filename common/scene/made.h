#pragma once
// Scenes that are made on demand, of any size: "--scene hall:detail=4,angle=30".

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/scene.h"

namespace trilha {

struct Parameter {
  const char* name;
  const char* help;
  double value, low, high;  ///< what it is unless said, and the range that it is taken from
  bool whole = true;        ///< only whole numbers
  /// Where it is a choice: the words for low, low + 1, …, high; the numbers stay good as well.
  std::vector<std::string> words = {};
};

/// Values for the parameters of a made scene.
class Parameters {
 public:
  /// Reads "name=value,name=value"; what is not named keeps its value. Throws InputError for a name that is
  /// not there (naming those that are), a name given twice, what is no number and no word for one, or out of
  /// range.
  Parameters(const std::string& scene, const std::vector<Parameter>& declared, std::string_view text,
             const LoadOptions& options = {});

  double operator[](std::string_view name) const;
  int whole(std::string_view name) const;
  /// LoadOptions::textures: may textures be left out?
  bool textures() const { return textures_; }

 private:
  std::vector<Parameter> values_;
  bool textures_;
};

/// What a made scene holds. Of each number at least what there will be, and at most twice that, but for
/// scenes of fewer than 10 000 triangles.
struct MadeSize {
  std::uint64_t stored = 0;  ///< triangles in its meshes
  std::uint64_t placed = 0;  ///< triangles as its instances place them
  std::uint64_t bodies = 0;  ///< spheres and planes
  std::uint64_t texels = 0;  ///< of its textures, without their smaller levels
};

struct MadeScene {
  const char* name;
  const char* what;  ///< for people, in a few words
  std::vector<Parameter> parameters;
  /// Makes it: the same bits for the same parameters, on any machine (so no sin, cos or pow of the C library:
  /// common/math/turn.h has them).
  Scene (*make)(const Parameters&);
  /// Says how large it will be, at once: scene files, which others write, name made scenes too.
  MadeSize (*size)(const Parameters&);
};

/// All of them.
const std::vector<MadeScene>& made_scenes();

// What the files in common/scene/made/ bring.
std::vector<MadeScene> hall_scenes();
std::vector<MadeScene> box_and_shape_scenes();
std::vector<MadeScene> whitted_scenes();
std::vector<MadeScene> still_life_scenes();
std::vector<MadeScene> loggia_scenes();
std::vector<MadeScene> feature_scenes();
std::vector<MadeScene> tea_scenes();
std::vector<MadeScene> extreme_scenes();

}  // namespace trilha
