#include <algorithm>

#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/01_ray_casting/triangle_blocks.h"
#include "common/parallel/for_each.h"

#if defined(__CUDACC__)
#include "chapters/01_ray_casting/triangle_tiles.h"
#endif

namespace trilha {

template <class Test, class T>
Buffer<T> prepare_triangles(const Stream& stream, Loop loop, const vec3* positions, const uvec3* triangles,
                            std::uint32_t count) {
  const bool blocks = stream.backend() == Backend::cpu && loop == Loop::blocked;
  const std::uint32_t lanes = blocks ? block_lanes : 1;
  const std::size_t padded = (static_cast<std::size_t>(count) + lanes - 1) / lanes * lanes;
  Buffer<T> numbers(stream.backend(), padded * Test::numbers);
  for_each(stream, padded, PrepareTriangles<Test, T>{positions, triangles, count, lanes, numbers.data()});
  return numbers;
}

template <class Test, class T>
void trace_triangles(const Stream& stream, Loop loop, const Triangles<Test, T>& triangles,
                     const RayOf<T>* rays, HitOf<T>* hits, std::size_t n) {
  if (loop == Loop::plain) {
    // On the CPU it is between batches that a pass can be cancelled: of many triangles, a batch is one ray.
    constexpr std::size_t most_tests = 1 << 17;  // in a batch: a millisecond or two
    const std::size_t batch = std::clamp<std::size_t>(most_tests / std::max(triangles.count, 1u), 1, 64);
    for_each(stream, n, Trace<BruteForce<Triangles<Test, T>>>{{triangles}, 0, rays, hits}, batch);
  } else if (stream.backend() == Backend::cpu) {
    trace_blocks(triangles, rays, hits, n);
  } else {
#if defined(__CUDACC__)
    trace_tiles(stream, triangles, rays, hits, n);
#endif
  }
}

#define INSTANTIATE(Test, T)                                                                                \
  template Buffer<T> prepare_triangles<Test, T>(const Stream&, Loop, const vec3*, const uvec3*,             \
                                                std::uint32_t);                                             \
  template void trace_triangles(const Stream&, Loop, const Triangles<Test, T>&, const RayOf<T>*, HitOf<T>*, \
                                std::size_t);
TRILHA_EVERY_TEST_AND_SCALAR(INSTANTIATE)
#undef INSTANTIATE

}  // namespace trilha
