#include <algorithm>

#include "chapters/01_ray_casting/structure.h"
#include "chapters/01_ray_casting/triangle_blocks.h"
#include "common/parallel/for_each.h"

#if defined(__CUDACC__)
#include "chapters/01_ray_casting/triangle_tiles.h"
#endif

namespace trilha {
namespace {

/// Ray → its hit among the triangles so far, of which these are a part: number `first` and those after it.
template <class Primitives>
struct TracePart {
  using T = typename Primitives::Scalar;
  Primitives part;
  std::uint32_t first;
  const RayOf<T>* rays;
  HitOf<T>* hits;

  TRILHA_HD void operator()(std::size_t i) const {
    RayOf<T> ray = rays[i];
    if (first > 0) ray.t_max = hits[i].t;  // only what is nearer counts; of equals the first stays
    NoProbe probe;
    HitOf<T> hit = BruteForce<Primitives>{part}.closest(ray, probe);
    if (hit.found()) hit.primitive += first;
    if (first == 0 || hit.found()) hits[i] = hit;
  }
};

/// Ray → whether it is occluded by the triangles so far, of which these are a part: number `first` and those
/// after it.
template <class Primitives>
struct OccludePart {
  using T = typename Primitives::Scalar;
  Primitives part;
  std::uint32_t first;
  const RayOf<T>* rays;
  std::uint8_t* occluded;

  TRILHA_HD void operator()(std::size_t i) const {
    if (first > 0 && occluded[i] != 0) return;
    NoProbe probe;
    occluded[i] = BruteForce<Primitives>{part}.occluded(rays[i], probe) ? 1 : 0;
  }
};

/// The passes that answer a query: among all triangles, and among a part of them after others.
template <Query query, class Primitives>
using WholePass = std::conditional_t<query == Query::closest, Trace<BruteForce<Primitives>>,
                                     Occlude<BruteForce<Primitives>>>;
template <Query query, class Primitives>
using PartPass = std::conditional_t<query == Query::closest, TracePart<Primitives>, OccludePart<Primitives>>;

/// The plain loop. On the CPU a pass can be cancelled between batches, which should take a few milliseconds:
/// of very many triangles a ray meets one part after the other. Smaller parts would stay in a cache, which is
/// what the blocks are for.
template <Query query, class Test, class T>
void trace_plain(const Stream& stream, const Triangles<Test, T>& triangles, const RayOf<T>* rays,
                 QueryAnswer<query, T>* answers, std::size_t n) {
  constexpr std::uint32_t most_triangles_a_part = 1 << 19, most_tests_a_batch = 1 << 17;
  const std::uint32_t count = triangles.count;
  const std::size_t batch = std::clamp<std::size_t>(most_tests_a_batch / std::max(count, 1u), 1, 64);
  if (stream.backend() == Backend::cuda || count <= most_triangles_a_part)
    return for_each(stream, n, WholePass<query, Triangles<Test, T>>{{triangles}, 0, rays, answers}, batch);
  for (std::size_t first = 0; first < count; first += most_triangles_a_part) {
    Triangles<Test, T> part = triangles;
    part.numbers += first * Test::numbers;
    part.count = static_cast<std::uint32_t>(std::min<std::size_t>(most_triangles_a_part, count - first));
    for_each(stream, n,
             PartPass<query, Triangles<Test, T>>{part, static_cast<std::uint32_t>(first), rays, answers},
             batch);
  }
}

/// Each ray's answer, by the loop's order on that backend.
template <Query query, class Test, class T>
void answer(const Stream& stream, Loop loop, const Triangles<Test, T>& triangles, const RayOf<T>* rays,
            QueryAnswer<query, T>* answers, std::size_t n) {
  if (loop == Loop::plain) {
    trace_plain<query>(stream, triangles, rays, answers, n);
  } else if (stream.backend() == Backend::cpu) {
    trace_blocks<query>(triangles, rays, answers, n);
  } else {
#if defined(__CUDACC__)
    trace_tiles<query>(stream, triangles, rays, answers, n);
#endif
  }
}

struct CountAll {
  std::uint32_t count;
  Probe* probes;
  TRILHA_HD void operator()(std::size_t i) const { probes[i] = {0, count}; }
};

template <class Test>
class BruteForceStructure final : public TriangleStructure {
 public:
  BruteForceStructure(const Stream& stream, Loop loop, const TriangleArrays& of)
      : stream_(stream),
        loop_(loop),
        count_(of.count),
        numbers_(prepare_triangles<Test, float>(stream, loop, of.positions, of.triangles, of.count)) {}

  void closest(const Ray* rays, Hit* hits, std::size_t n) const override {
    trace_triangles(stream_, loop_, triangles(), rays, hits, n);
  }
  void occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const override {
    occluded_triangles(stream_, loop_, triangles(), rays, occluded, n);
  }
  void probe(const Ray*, Probe* probes, std::size_t n) const override {
    for_each(stream_, n, CountAll{count_, probes});
  }

 private:
  Triangles<Test> triangles() const {
    return {numbers_.data(), count_, rules_.one_sided, rules_.surely_ahead};
  }

  Stream stream_;
  Loop loop_;
  std::uint32_t count_;
  Buffer<float> numbers_;
};

}  // namespace

MakeStructure brute_force(TriangleTest test, Loop loop) {
  return [=](const Stream& stream, const TriangleArrays& triangles) {
    return with_test(test, [&](auto chosen) -> std::unique_ptr<TriangleStructure> {
      return std::make_unique<BruteForceStructure<decltype(chosen)>>(stream, loop, triangles);
    });
  };
}

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
  answer<Query::closest>(stream, loop, triangles, rays, hits, n);
}

template <class Test, class T>
void occluded_triangles(const Stream& stream, Loop loop, const Triangles<Test, T>& triangles,
                        const RayOf<T>* rays, std::uint8_t* occluded, std::size_t n) {
  answer<Query::occluded>(stream, loop, triangles, rays, occluded, n);
}

#define INSTANTIATE(Test, T)                                                                                \
  template Buffer<T> prepare_triangles<Test, T>(const Stream&, Loop, const vec3*, const uvec3*,             \
                                                std::uint32_t);                                             \
  template void trace_triangles(const Stream&, Loop, const Triangles<Test, T>&, const RayOf<T>*, HitOf<T>*, \
                                std::size_t);                                                               \
  template void occluded_triangles(const Stream&, Loop, const Triangles<Test, T>&, const RayOf<T>*,         \
                                   std::uint8_t*, std::size_t);
TRILHA_EVERY_TEST_AND_SCALAR(INSTANTIATE)
#undef INSTANTIATE

}  // namespace trilha
