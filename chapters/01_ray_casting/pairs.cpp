#include "chapters/01_ray_casting/pairs.h"

#include "common/parallel/buffer.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

struct MakePairs {
  PairKind kind;
  std::uint64_t seed;
  Pair* out;

  TRILHA_HD void operator()(std::size_t i) const {
    Random random(seed, i);
    out[i] = make_pair(random, kind);
  }
};

template <class Test, class T>
struct AnswerPairs {
  const Pair* pairs;
  Answer<T>* out;

  TRILHA_HD void operator()(std::size_t i) const {
    const Pair& p = pairs[i];
    Solution<T> s{};
    const bool hit = intersect<Test>(Vec3<T>(p.a), Vec3<T>(p.b), Vec3<T>(p.c), p.ray.template as<T>(), s);
    out[i] = hit ? Answer<T>{1, s.front, s.t, s.u, s.v} : Answer<T>{};
  }
};

}  // namespace

std::vector<Pair> make_pairs(PairKind kind, std::size_t n, std::uint64_t seed) {
  std::vector<Pair> pairs(n);
  for_each(Backend::cpu, n, MakePairs{kind, seed, pairs.data()});
  return pairs;
}

template <class Test, class T>
std::vector<Answer<T>> answers(const Stream& stream, const std::vector<Pair>& pairs) {
  const Buffer<Pair> there(stream, pairs);
  Buffer<Answer<T>> out(stream.backend(), pairs.size());
  for_each(stream, pairs.size(), AnswerPairs<Test, T>{there.data(), out.data()});
  return out.to_vector(stream);
}

#define INSTANTIATE(Test, T) \
  template std::vector<Answer<T>> answers<Test, T>(const Stream&, const std::vector<Pair>&);
TRILHA_EVERY_TEST_AND_SCALAR(INSTANTIATE)
#undef INSTANTIATE

}  // namespace trilha
