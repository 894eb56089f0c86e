#pragma once
// What the chapter can be asked for, beside the terms of Whitted's equation.

#include "chapters/02_whitted/scene_view.h"

namespace trilha {

/// How a pixel's colour is made of rays; see antialiasing.h.
enum class Antialiasing { none, grid, jittered, low_discrepancy, adaptive };
constexpr Antialiasing all_antialiasing[] = {Antialiasing::none, Antialiasing::grid, Antialiasing::jittered,
                                             Antialiasing::low_discrepancy, Antialiasing::adaptive};
inline const char* name(Antialiasing method) {
  constexpr const char* names[] = {"none", "grid", "jittered", "low-discrepancy", "adaptive"};
  return names[static_cast<int>(method)];
}

/// Which program follows the tree: split kernels over buffers, one fused function, or one of the three that
/// Ordeix & Cioli (2010) measured; see rt_gpu.h.
enum class Kernel { split, fused, rt_gpu, rt_gpu_jm, rt_gpu_jm_ir };
constexpr Kernel all_kernels[] = {Kernel::split, Kernel::fused, Kernel::rt_gpu, Kernel::rt_gpu_jm,
                                  Kernel::rt_gpu_jm_ir};
inline const char* name(Kernel kernel) {
  constexpr const char* names[] = {"split", "fused", "rt-gpu", "rt-gpu-jm", "rt-gpu-jm-ir"};
  return names[static_cast<int>(kernel)];
}
inline bool is_rt_gpu(Kernel kernel) { return kernel >= Kernel::rt_gpu; }

/// What a pixel shows: its light, or what that took.
enum class Show { picture, rays, samples, visited, tested };
/// Is that what the eye's rays take in a structure?
inline bool shows_structure(Show show) { return show == Show::visited || show == Show::tested; }

/// What is uploaded or compiled in although scene and settings do not need it: to measure what leaving it out
/// saves.
struct KeepWhitted {
  bool normals = false;
  bool texture_coordinates = false;
  bool textures = false;
  bool general_kernel = false;  ///< the one with code for every feature
};

struct WhittedSettings {
  Terms terms;
  bool maps = true;  ///< textures are looked up; else what they multiply stands alone
  bool shadow_cache = false;
  Antialiasing antialiasing = Antialiasing::low_discrepancy;
  int across = 2;          ///< of the n×n patterns: n
  float threshold = 0.1f;  ///< of the adaptive one: corners that differ by more are not alike
  int adaptive_depth = 3;  ///< how often it may halve a pixel
  Kernel kernel = Kernel::split;
  TriangleTest test = TriangleTest::watertight;
  int block_width = 8,
      block_height = 16;   ///< threads of a block of the rt-gpu kernels, as their authors had it
  bool specialise = true;  ///< false keeps everything
  Show show = Show::picture;
  KeepWhitted keep;
};

/// The features that the scene has and the settings look at.
unsigned features_used(const Scene& scene, const WhittedSettings& settings);

}  // namespace trilha
