#pragma once
// Brute force in the loop order of a GPU: a block of threads, some rays each, brings a tile of triangles into
// shared memory together, then every thread tests its rays against the tile. All threads of a warp read the
// same triangle at the same time, which shared memory serves in one go. The result is that of BruteForce, bit
// for bit.

#include <type_traits>

#include "chapters/01_ray_casting/ray_casting.h"
#include "common/parallel/cancellation.h"
#include "cuda/check.h"

namespace trilha {

constexpr int tile_threads = 128;
constexpr int tile_triangles = 128;
/// They share what is read of a triangle, and hide each other's latency; doubles fill the registers sooner.
template <class T>
constexpr int rays_a_thread = sizeof(T) == 4 ? 4 : 2;

/// One triangle in shared memory, read 16 bytes at a time, whatever the test keeps.
template <class T>
struct alignas(16) TileSlot {
  T numbers[12];
};

/// Measures the triangle in a slot. In a turned tile coordinates lie in the order that all the rays want.
template <bool turned, class Test, class T, class Constants>
__device__ inline auto measure_slot(const T* s, const RayOf<T>& ray, const Constants& constants) {
  if constexpr (turned) {
    return Test::measure_turned(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], constants);
  } else {
    return Test::measure(Numbers<T>{s}, ray, constants);
  }
}

/// The rare second half. It is a call, so that its many registers do not weigh on the loop.
template <bool turned, class Test, class T, class Constants>
__device__ __noinline__ HitOf<T> settle_slot(const Triangles<Test, T> triangles, const T* slot,
                                             std::uint32_t i, const RayOf<T> ray, const Constants constants,
                                             HitOf<T> hit) {
  const auto measure = measure_slot<turned, Test>(slot, ray, constants);
  if (!Test::may_hit(measure)) return hit;
  if constexpr (turned) {  // to settle, a triangle is wanted as it was
    T numbers[Test::numbers];
    for (int v = 0; v < Test::numbers; v += 3) {
      numbers[v + constants.kx] = slot[v];
      numbers[v + constants.ky] = slot[v + 1];
      numbers[v + constants.kz] = slot[v + 2];
    }
    triangles.settle(measure, Numbers<T>{numbers}, i, ray, constants, hit);
  } else {
    triangles.settle(measure, Numbers<T>{slot}, i, ray, constants, hit);
  }
  return hit;
}

/// Tests a thread's rays against the tile: measured without a branch, one branch for all of them.
template <bool turned, class Test, class T, class Constants>
__device__ inline void test_tile(const Triangles<Test, T>& triangles, const TileSlot<T>* tile,
                                 std::uint32_t begin, std::uint32_t count, const RayOf<T>* ray,
                                 const Constants* constants, HitOf<T>* hit) {
#pragma unroll 2
  for (std::uint32_t j = 0; j < count; ++j) {
    const T* slot = tile[j].numbers;
    bool any = false;
    for (int r = 0; r < rays_a_thread<T>; ++r)
      any |= Test::may_hit(measure_slot<turned, Test>(slot, ray[r], constants[r]));
    if (!any) continue;
    for (int r = 0; r < rays_a_thread<T>; ++r)
      hit[r] = settle_slot<turned>(triangles, slot, begin + j, ray[r], constants[r], hit[r]);
  }
}

/// The same for rays that are asked whether there is any hit: those that have none, or cannot have one, are
/// looked at no more, and the thread leaves the tile when all are done.
template <bool turned, class Test, class T, class Constants>
__device__ inline void test_tile_for_any(const Triangles<Test, T>& triangles, const TileSlot<T>* tile,
                                         std::uint32_t begin, std::uint32_t count, const RayOf<T>* ray,
                                         const Constants* constants, bool* done, bool* occluded) {
  bool all_done = true;
  for (int r = 0; r < rays_a_thread<T>; ++r) all_done = all_done && done[r];
  for (std::uint32_t j = 0; j < count && !all_done; ++j) {
    const T* slot = tile[j].numbers;
    bool any = false;
    for (int r = 0; r < rays_a_thread<T>; ++r)
      any |= Test::may_hit(measure_slot<turned, Test>(slot, ray[r], constants[r])) & !done[r];
    if (!any) continue;
    all_done = true;
    for (int r = 0; r < rays_a_thread<T>; ++r) {
      if (!done[r]) {
        HitOf<T> hit;
        hit.t = ray[r].t_max;
        done[r] = occluded[r] =
            settle_slot<turned>(triangles, slot, begin + j, ray[r], constants[r], hit).found();
      }
      all_done = all_done && done[r];
    }
  }
}

template <Query query, class Test, class T>
__global__ void __launch_bounds__(tile_threads, 3)
    trace_tiles_kernel(const Triangles<Test, T> triangles, const RayOf<T>* rays,
                       QueryAnswer<query, T>* answers, std::size_t n) {
  constexpr bool watertight = std::is_same_v<Test, Watertight>;
  constexpr int own = rays_a_thread<T>;
  __shared__ TileSlot<T> tile[tile_triangles];

  RayOf<T> ray[own];
  decltype(Test::constants(RayOf<T>{})) constants[own];
  [[maybe_unused]] HitOf<T> hit[own];                        // of the one query
  [[maybe_unused]] bool done[own] = {}, occluded[own] = {};  // of the other
  const std::size_t first = static_cast<std::size_t>(blockIdx.x) * tile_threads * own + threadIdx.x;
  for (int r = 0; r < own; ++r) {
    const std::size_t i = first + r * tile_threads;
    ray[r] = rays[i < n ? i : n - 1];
    constants[r] = Test::constants(ray[r]);
    if constexpr (query == Query::closest)
      hit[r].t = ray[r].t_max;
    else
      done[r] = !(ray[r].t_min < ray[r].t_max);  // nothing can be hit
  }

  // The watertight test reads coordinates in an order that depends on the ray. Where all rays of the block
  // want the same order, which neighbours nearly always do, the triangles are turned once, on their way into
  // the tile.
  int turn = -1;
  if constexpr (watertight) {
    __shared__ int wanted;
    if (threadIdx.x == 0) wanted = constants[0].kz;
    __syncthreads();
    bool agreed = true;
    for (int r = 0; r < own; ++r) agreed = agreed && constants[r].kz == wanted;
    if (__syncthreads_and(agreed)) turn = wanted;
  }

  for (std::size_t first_triangle = 0; first_triangle < triangles.count; first_triangle += tile_triangles) {
    const auto begin = static_cast<std::uint32_t>(first_triangle);
    const std::uint32_t count = min(triangles.count - begin, static_cast<std::uint32_t>(tile_triangles));
    if constexpr (query == Query::closest) {
      __syncthreads();
    } else {
      bool all_done = true;
      for (int r = 0; r < own; ++r) all_done = all_done && done[r];
      if (__syncthreads_and(all_done)) break;
    }
    for (std::uint32_t k = threadIdx.x; k < count * Test::numbers; k += tile_threads) {
      const std::uint32_t triangle = k / Test::numbers, number = k % Test::numbers;
      std::uint32_t place = number;
      if (turn >= 0) place = number / 3 * 3 + (number % 3 + 2 - turn) % 3;  // axis `turn` becomes the third
      tile[triangle].numbers[place] = triangles.numbers[static_cast<std::size_t>(begin) * Test::numbers + k];
    }
    __syncthreads();
    if constexpr (query == Query::closest) {
      if (watertight && turn >= 0) {
        test_tile<watertight>(triangles, tile, begin, count, ray, constants, hit);
      } else {
        test_tile<false>(triangles, tile, begin, count, ray, constants, hit);
      }
    } else {
      if (watertight && turn >= 0) {
        test_tile_for_any<watertight>(triangles, tile, begin, count, ray, constants, done, occluded);
      } else {
        test_tile_for_any<false>(triangles, tile, begin, count, ray, constants, done, occluded);
      }
    }
  }
  for (int r = 0; r < own; ++r) {
    const std::size_t i = first + r * tile_threads;
    if (i >= n) continue;
    if constexpr (query == Query::closest)
      answers[i] = hit[r];
    else
      answers[i] = occluded[r] ? 1 : 0;
  }
}

/// The nearest hit of each of n rays, or whether there is any; all arrays lie on the device. Where that is
/// asked, a thread whose rays are done tests nothing, and a block ends when all of its are.
template <Query query, class Test, class T>
void trace_tiles(const Stream& stream, const Triangles<Test, T>& triangles, const RayOf<T>* rays,
                 QueryAnswer<query, T>* answers, std::size_t n) {
  stop_if_cancelled();
  if (n == 0) return;
  constexpr std::size_t rays_a_block = tile_threads * rays_a_thread<T>;
  const auto blocks = static_cast<unsigned>((n + rays_a_block - 1) / rays_a_block);
  trace_tiles_kernel<query>
      <<<blocks, tile_threads, 0, cuda::as_stream(stream.native())>>>(triangles, rays, answers, n);
  cuda::check(cudaGetLastError(), "trace_tiles_kernel");
}

}  // namespace trilha
