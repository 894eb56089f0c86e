#include "chapters/01_ray_casting/triangle_blocks.h"

#include <algorithm>

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

constexpr std::size_t most_rays = 256;         // that share a chunk
constexpr std::size_t chunk_bytes = 16 << 10;  // half of a first-level cache

/// Tests one ray against one block. Measuring is a loop without a branch, which the compiler turns into
/// vectors; the few lanes that pass are settled one by one, by the code of the plain loop. As a call it would
/// make the nearest hit of the watertight test a quarter slower.
template <class Test, class T, class Constants>
[[gnu::always_inline]] inline void test_block(const Triangles<Test, T>& triangles, std::uint32_t block,
                                              const RayOf<T>& ray, const Constants& constants,
                                              HitOf<T>& hit) {
  const T* numbers = triangles.numbers + static_cast<std::size_t>(block) * block_lanes * Test::numbers;
  alignas(64) std::uint32_t passed[block_lanes];
  std::uint32_t any = 0;
  for (std::uint32_t lane = 0; lane < block_lanes; ++lane) {
    const bool pass = Test::may_hit(Test::measure(Numbers<T>{numbers + lane, block_lanes}, ray, constants));
    passed[lane] = pass ? 1 : 0;
    any |= passed[lane];
  }
  if (any == 0) return;
  for (std::uint32_t lane = 0; lane < block_lanes; ++lane) {
    const std::uint32_t i = block * block_lanes + lane;
    if (passed[lane] == 0 || i >= triangles.count) continue;
    const Numbers<T> triangle{numbers + lane, block_lanes};
    triangles.settle(Test::measure(triangle, ray, constants), triangle, i, ray, constants, hit);
  }
}

/// Tests rays against the blocks begin, …, end−1.
template <class Test, class T, class Constants>
void test_chunk(const Triangles<Test, T>& triangles, std::uint32_t begin, std::uint32_t end,
                const RayOf<T>* rays, const Constants* constants, HitOf<T>* hits, std::size_t n) {
  for (std::size_t r = 0; r < n; ++r) {
    const RayOf<T> ray = rays[r];
    const Constants own = constants[r];
    HitOf<T> hit = hits[r];
    for (std::uint32_t block = begin; block < end; ++block) test_block(triangles, block, ray, own, hit);
    hits[r] = hit;
  }
}

/// The same for rays that are asked whether there is any hit: `open` lists those that have none so far, among
/// the batch's. Returns how many of them still have none, and keeps these in the list.
template <class Test, class T, class Constants>
std::size_t test_chunk_for_any(const Triangles<Test, T>& triangles, std::uint32_t begin, std::uint32_t end,
                               const RayOf<T>* rays, const Constants* constants, std::uint8_t* occluded,
                               std::uint32_t* open, std::size_t n) {
  std::size_t left = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const std::uint32_t r = open[k];
    const RayOf<T> ray = rays[r];
    const Constants own = constants[r];
    HitOf<T> hit;
    hit.t = ray.t_max;
    for (std::uint32_t block = begin; block < end && !hit.found(); ++block)
      test_block(triangles, block, ray, own, hit);
    if (hit.found())
      occluded[r] = 1;
    else
      open[left++] = r;
  }
  return left;
}

/// Batch of rays → their answers, chunk by chunk. Between chunks, a tenth of a millisecond each, it asks
/// whether to go on: all of them may take minutes.
template <Query query, class Test, class T>
struct TraceBatch {
  Triangles<Test, T> triangles;
  const RayOf<T>* rays;
  QueryAnswer<query, T>* answers;
  std::size_t n, batch;

  void operator()(std::size_t b) const {
    constexpr std::uint32_t chunk = chunk_bytes / (block_lanes * Test::numbers * sizeof(T));
    const auto blocks =
        static_cast<std::uint32_t>((std::size_t{triangles.count} + block_lanes - 1) / block_lanes);
    const std::size_t first = b * batch, count = std::min(n - first, batch);
    decltype(Test::constants(RayOf<T>{})) constants[most_rays];
    for (std::size_t r = 0; r < count; ++r) {
      constants[r] = Test::constants(rays[first + r]);
      answers[first + r] = {};
      if constexpr (query == Query::closest) answers[first + r].t = rays[first + r].t_max;
    }
    if constexpr (query == Query::closest) {
      for (std::uint32_t begin = 0; begin < blocks && !is_cancelled(); begin += chunk)
        test_chunk(triangles, begin, std::min(blocks, begin + chunk), rays + first, constants,
                   answers + first, count);
    } else {
      std::uint32_t open[most_rays];
      std::size_t left = 0;
      for (std::uint32_t r = 0; r < count; ++r)
        if (rays[first + r].t_min < rays[first + r].t_max) open[left++] = r;  // else nothing can be hit
      for (std::uint32_t begin = 0; begin < blocks && left > 0 && !is_cancelled(); begin += chunk)
        left = test_chunk_for_any(triangles, begin, std::min(blocks, begin + chunk), rays + first, constants,
                                  answers + first, open, left);
    }
  }
};

}  // namespace

template <Query query, class Test, class T>
void trace_blocks(const Triangles<Test, T>& triangles, const RayOf<T>* rays, QueryAnswer<query, T>* answers,
                  std::size_t n) {
  // Few rays are shared out among the threads, down to sixteen, which still use a chunk well once it is
  // there.
  const auto threads = static_cast<std::size_t>(thread_count());
  const std::size_t batch =
      threads == 1 ? most_rays : std::clamp<std::size_t>(n / (2 * threads), 16, most_rays);
  for_each(Backend::cpu, (n + batch - 1) / batch,
           TraceBatch<query, Test, T>{triangles, rays, answers, n, batch}, 1);
}

#define INSTANTIATE(Test, T)                                                                             \
  template void trace_blocks<Query::closest>(const Triangles<Test, T>&, const RayOf<T>*, HitOf<T>*,      \
                                             std::size_t);                                               \
  template void trace_blocks<Query::occluded>(const Triangles<Test, T>&, const RayOf<T>*, std::uint8_t*, \
                                              std::size_t);
TRILHA_EVERY_TEST_AND_SCALAR(INSTANTIATE)
#undef INSTANTIATE

}  // namespace trilha
