#pragma once
// The three programs of Ordeix & Cioli (2010, section 4.3) once more, with the grid that they had: chapter 02
// has them by brute force, rt_gpu.h there says what each is.
//
// - RT-GPU: the cells and their lists in global memory, beside the list of objects.
// - RT-GPU-JM and -JM-IR: the cells and their lists, too, are read through textures, as vectors of four
// numbers.
//   What there is once, the grid's corner and size, lies in constant memory.
//
// On the CPU the same arrangements lie in its one memory: the twins.

#include "chapters/02_whitted/rt_gpu.h"
#include "chapters/03_uniform_grid/uniform_grid.h"

namespace trilha {

/// An array of whole numbers, four to a texel.
struct TexelNumbers {
  Texels texels;

  TRILHA_HD std::uint32_t operator[](std::size_t i) const {
    const vec4 four = texels[i / 4];
    const std::size_t k = i % 4;  // not four[k]: that would put it into local memory
    return as_bits(k == 0 ? four.x : k == 1 ? four.y : k == 2 ? four.z : four.w);
  }
};

/// As GridView, with its arrays read through textures.
struct TextureGridView {
  GridView view;  ///< its own arrays are not read
  TexelNumbers starts, primitives;
};

/// The same hits as UniformGrid.
template <class Primitives>
struct TextureGrid {
  using Scalar = float;
  TextureGridView grid;
  Primitives primitives;

  template <class ProbeType>
  TRILHA_HD Hit closest(const Ray& ray, ProbeType& probe) const {
    if (asks_all(grid.view, ray)) return BruteForce<Primitives>{primitives}.closest(ray, probe);
    AskCell<Query::closest, Primitives, ProbeType, TextureGridView> ask{grid, primitives, ray, probe};
    walk(grid.view, ray, ask);
    return ask.hit;
  }
  template <class ProbeType>
  TRILHA_HD bool occluded(const Ray& ray, ProbeType& probe) const {
    if (asks_all(grid.view, ray)) return BruteForce<Primitives>{primitives}.occluded(ray, probe);
    AskCell<Query::occluded, Primitives, ProbeType, TextureGridView> ask{grid, primitives, ray, probe};
    walk(grid.view, ray, ask);
    return ask.hit.found();
  }
};

/// One of the three programs with a grid, on the device or as its twin on the CPU.
class RtGrid {
 public:
  /// As RtGpu's. The grid is built over the scene's triangles. Throws InputError also where a texture is too
  /// short for the cells or their lists, and Cancelled.
  RtGrid(const WhittedScene& scene, Kernel version, int block_width, int block_height,
         const GridSettings& settings, const Stream& stream);
  ~RtGrid();
  RtGrid(const RtGrid&) = delete;
  RtGrid& operator=(const RtGrid&) = delete;

  /// As SplitTrees::colours says.
  void colours(const Terms& terms, const Ray* rays, vec4* colours, std::size_t n) const;
  const GridStatistics& statistics() const { return statistics_; }
  /// What its kernel takes of a CUDA device; nothing on the CPU.
  std::optional<KernelCost> cost() const;

 private:
  TexelNumbers texels(const Buffer<std::uint32_t>& numbers, Buffer<vec4>& texels);
  template <class Function>
  auto with_pass(const Terms& terms, const Ray* rays, vec4* colours, const Function& function) const;

  Stream stream_;
  RtGpu scene_;
  Kernel version_;
  unsigned threads_;
  std::uint32_t count_;
  GridView view_;
  GridStatistics statistics_;
  TextureGridView texture_view_{};
  Buffer<std::uint32_t> starts_, primitives_;
  Buffer<vec4> texels_[2];
  std::vector<std::uint64_t> textures_;
};

}  // namespace trilha
