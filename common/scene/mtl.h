#pragma once
// Wavefront material libraries (MTL).

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/scene.h"

namespace trilha {

/// Names in quotes, a few of them: a warning does not grow with the file.
class Listed {
 public:
  static constexpr std::size_t most = 8;

  void add(std::string_view name);
  bool empty() const { return count_ == 0; }
  std::string text() const;  ///< "'a', 'b' and 3 more"

 private:
  std::size_t count_ = 0;
  std::string text_;
};

/// What material libraries say, as long as no one has asked for it: no image is read before.
///
/// Read are (Alias|Wavefront 1995, "Material Library File"; the extension for physically based rendering by
/// Clara.io): Kd Ks Ke Kt Tf (three numbers, or one for grey), Ni Ns d (also -halo, whose halo is left out)
/// Tr (1 − d) illum Pr Pm, the maps map_Kd map_Ks map_Ke map_d map_Pr map_Pm norm, and bump, also written
/// map_Bump, with the options -s -o -clamp -bm -imfchan and -mm where its base is 0. `r`, a reflection
/// coefficient, is an extension by Micah Taylor's objLoader. Accepted, and counted as ignored in a warning:
/// spectral and xyz colours, Ps Pc Pcr aniso anisor sharpness map_aat, the maps map_Ka map_Ns map_Ps decal
/// disp refl, options that say more than this (-t -boost -texres -cc -type, -blendu off …), and statements
/// that nobody knows. Ka is checked; Scene has one ambient light instead.
///
/// What becomes of them in a Material:
/// - A colour or number that is not given is the Material's default, or 1 where a map is to be multiplied
///   with it.
/// - Ns is the shininess. Without Pr and map_Pr the roughness is ⁴√(2 / (Ns + 2)): a lobe as wide, where the
///   roughness squared is the slope of the microfacets (Walter et al. 2007, section 5.2).
/// - illum 3, 5, 6 and 7: what Ks reflects (at most 1) is mirrored too: Material::reflection. So it is with
///   illum 4 where d < 1; without, 4 is what some programs write for every surface.
/// - illum 4, 6, 7 and 9: what passes is refracted. Material::transmission is Kt; without it, for 6 and 7,
///   (1 − reflection)·Tf, as the format has it; else (1 − d)·Tf, and Tf is 1 where it is missing. d then
///   scales the diffuse colour and the surface is opaque but for map_d. Without an illum statement Kt alone
///   does that.
/// - r: reflection, and (1 − d)·Tf, refracted, is transmission: so the system of Ordeix & Cioli (2010) reads
///   such materials.
/// - All other d is Material::opacity. map_d is looked up in alpha where its image has some, else in red;
///   -imfchan says otherwise.
class MaterialLibraries {
 public:
  /// Adds the materials in that library; of a name, the first one holds. Throws InputError where the file
  /// cannot be read, or a statement that is understood is malformed, comes before any newmtl, or has a number
  /// out of its range: 0 to 1e6 for Kd Ks Ke Ka, 0 to 1 for Kt Tf d Tr Pr Pm r, 0 to 1e6 for Ns, 0.001 to
  /// 100 for Ni (0, which some programs write, means that there is none), a whole number from 0 to 10 for
  /// illum.
  void read(const std::string& path, std::vector<std::string>& warnings);

  /// The material of that name, with its maps in scene.textures; none where no library defines it. Throws
  /// InputError where an image is refused or lies where none may be read (named_file).
  std::optional<Material> material(const std::string& name, TextureSet& textures, const LoadOptions& options,
                                   Scene& scene);

  /// Adds what there is to say about the materials that were asked for: a line a kind, which names eight.
  void warn(std::vector<std::string>& warnings) const;

  /// What a light that has the material of that name gives off: its Kd, or its Ke where that is not black.
  std::optional<vec3> light_of(const std::string& name) const;

 private:
  enum Slot { diffuse, specular, emission, opacity, roughness, metallic, bump, normal, slots };

  /// A map statement.
  struct MapStatement {
    std::string file;  ///< empty: there is none
    std::size_t line = 0;
    bool clamp = false;
    std::int8_t channel = -1;  ///< −1: not said
    vec2 scale{1}, offset{0};
    float gain = 1;
    float bump = 1;
  };

  struct Definition {
    std::string library;
    std::size_t line = 0;
    std::optional<vec3> diffuse, specular, emission, transmission, filter;
    std::optional<float> dissolve, shininess, refraction_index, reflection, roughness, metallic;
    std::optional<int> illumination;
    MapStatement maps[slots];
  };

  class Reader;

  static Material made(const std::string& name, const Definition& definition);

  /// Materials of which there is the same to say.
  struct Remark {
    Listed names;
    std::string place;  // of the first

    void add(const std::string& name, const std::string& library, std::size_t line);
  };

  std::map<std::string, Definition> definitions_;
  Remark invisible_, beyond_range_;
};

}  // namespace trilha
