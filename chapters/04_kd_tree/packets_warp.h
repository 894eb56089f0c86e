#pragma once
// Packets on the device: the rays of a warp go through the tree together, with one stack of nodes in shared
// memory. Each thread keeps where its own ray is; they vote on the way. All threads read the same node and
// the same triangle at the same time. Only for nvcc.

#include "chapters/04_kd_tree/packets.h"
#include "cuda/check.h"

namespace trilha {

constexpr int kd_warp_threads = 128, kd_warps = kd_warp_threads / 32;

template <Query query, class Primitives>
__global__ void __launch_bounds__(kd_warp_threads)
    trace_kd_warps_kernel(const KdTreeView tree, const Primitives primitives, const Ray* rays,
                          QueryAnswer<query, float>* answers, std::size_t n) {
  constexpr unsigned everyone = 0xffffffffu;
  __shared__ std::uint32_t nodes[kd_warps][kd_most_depth];
  std::uint32_t* stack = nodes[threadIdx.x / 32];
  float begins[kd_most_depth], ends[kd_most_depth];  // all threads at the same height: one transaction
  const std::size_t i = static_cast<std::size_t>(blockIdx.x) * kd_warp_threads + threadIdx.x;
  const Ray ray = rays[i < n ? i : n - 1];
  Hit hit;
  hit.t = ray.t_max;
  const auto constants = primitives.constants(ray);
  KdRay<float> walk;
  if (!(i < n && walk.enter(tree, ray))) {  // asks for nothing, but votes
    walk.origin = vec3(0);
    walk.inverse = vec3(1);
    walk.slack = walk.speed = 0;
    walk.begin = std::numeric_limits<float>::infinity();
    walk.end = -walk.begin;
  }
  // the way that most rays go along each axis
  unsigned upwards = 0;
  const unsigned asking = __ballot_sync(everyone, walk.begin <= walk.end);
  for (int k = 0; k < 3; ++k)
    upwards |=
        2 * __popc(__ballot_sync(everyone, walk.inverse[k] > 0) & asking) >= __popc(asking) ? 1u << k : 0u;

  float begin = walk.begin, end = walk.end, nearest = walk.end;
  int height = 0;
  std::uint32_t number = 0;
  bool more = asking != 0;
  while (more) {
    KdNode node = tree.nodes[number];
    while (!node.is_leaf()) {
      const auto crossing = walk.cross(node);
      const bool up = crossing.first == node.child();  // this ray meets the left child first
      const float first_end = quick_min(end, crossing.first_end);
      const float second_begin = quick_max(begin, crossing.second_begin);
      const float left_begin = up ? begin : second_begin, left_end = up ? first_end : end;
      const float right_begin = up ? second_begin : begin, right_end = up ? end : first_end;
      const bool in_left = __any_sync(everyone, left_begin <= quick_min(left_end, nearest)) != 0;
      const bool in_right = __any_sync(everyone, right_begin <= quick_min(right_end, nearest)) != 0;
      const bool to_left = in_left && (!in_right || (upwards >> node.axis() & 1) != 0);
      if (in_left && in_right) {
        if (threadIdx.x % 32 == 0) stack[height] = node.child() + (to_left ? 1 : 0);
        begins[height] = to_left ? right_begin : left_begin;
        ends[height] = to_left ? right_end : left_end;
        ++height;
      }
      number = node.child() + (to_left ? 0 : 1);
      begin = to_left ? left_begin : right_begin;
      end = to_left ? left_end : right_end;
      node = tree.nodes[number];
    }
    if (begin <= quick_min(end, nearest)) {
      NoProbe probe;
      test_leaf<query == Query::occluded>(tree, node, primitives, ray, constants, hit, probe);
      nearest = hit.t * walk.speed;
      if (query == Query::occluded && hit.found()) nearest = -std::numeric_limits<float>::infinity();
    }
    do {
      more = height > 0;
      if (!more) break;
      --height;
      __syncwarp();  // it has been written
      number = stack[height];
      __syncwarp();  // and read by all, before it is written again
      begin = begins[height];
      end = ends[height];
    } while (!__any_sync(everyone, begin <= quick_min(end, nearest)));
  }
  if (i >= n) return;
  if constexpr (query == Query::closest)
    answers[i] = hit;
  else
    answers[i] = hit.found() ? 1 : 0;
}

/// The answers of n rays; all arrays lie on the device.
template <Query query, class Primitives>
void trace_kd_warps(const Stream& stream, const KdTreeView& tree, const Primitives& primitives,
                    const Ray* rays, QueryAnswer<query, float>* answers, std::size_t n) {
  constexpr std::size_t most = std::size_t{kd_warp_threads} << 30;
  for (std::size_t first = 0; first < n; first += most) {
    const std::size_t count = n - first < most ? n - first : most;
    const auto blocks = static_cast<unsigned>((count + kd_warp_threads - 1) / kd_warp_threads);
    trace_kd_warps_kernel<query><<<blocks, kd_warp_threads, 0, cuda::as_stream(stream.native())>>>(
        tree, primitives, rays + first, answers + first, count);
    cuda::check(cudaGetLastError(), "trace_kd_warps_kernel");
  }
}

}  // namespace trilha
