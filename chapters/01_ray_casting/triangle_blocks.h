#pragma once
// Brute force in the loop order of a CPU: triangles lie in blocks of 16, number by number, so that one
// instruction measures as many as a vector has lanes; and a batch of rays goes through a chunk of blocks that
// fits the first-level cache before the next chunk is touched. The result is that of BruteForce, bit for bit.

#include "chapters/01_ray_casting/ray_casting.h"

namespace trilha {

/// Triangles in a block: two AVX2 vectors, or one of AVX-512. Independent vectors hide each other's latency.
constexpr std::uint32_t block_lanes = 16;

/// The nearest hit of each of n rays among the triangles, whose numbers lie in blocks of `block_lanes`; or
/// whether there is any: then a ray that has one meets no further block, and a batch whose rays all have one
/// no further chunk.
template <Query query, class Test, class T>
void trace_blocks(const Triangles<Test, T>& triangles, const RayOf<T>* rays, QueryAnswer<query, T>* answers,
                  std::size_t n);

}  // namespace trilha
