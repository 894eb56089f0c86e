#include <cmath>
#include <set>

#include "common/math/box.h"
#include "common/math/precision.h"
#include "common/math/random.h"
#include "tests/testing.h"

using namespace trilha;

// Catches: arithmetic that the compiler fused: a·b + c with and without fma has to differ where rounding says
// so.
TEST_CASE("nothing is fused but what the code fuses") {
  volatile float a = 1.0f + 0x1p-12f, c = -(1.0f + 0x1p-11f);  // a·a = 1 + 2⁻¹¹ + 2⁻²⁴, which rounds to −c
  CHECK(a * a + c == 0.0f);
  CHECK(trilha::fma<float>(a, a, c) == 0x1p-24f);
}

// Catches: a product taken in the wrong order or component; more roundings than promised.
TEST_CASE("fused products are the products, within their bounds") {
  Random random(1);
  for (int k = 0; k < 100000; ++k) {
    vec3 a, b;
    for (int c = 0; c < 3; ++c) a[c] = random.uniform(-1, 1), b[c] = random.uniform(-1, 1);
    const dvec3 exact = glm::cross(dvec3(a), dvec3(b));
    const vec3 cross = fused_cross(a, b);
    double sizes = 0, dot = 0;
    for (int c = 0; c < 3; ++c) {
      const int p = (c + 1) % 3, q = (c + 2) % 3;
      const double terms = std::fabs(double(a[p]) * b[q]) + std::fabs(double(a[q]) * b[p]);
      REQUIRE(std::fabs(cross[c] - exact[c]) <= gamma<float>(2) * terms);
      sizes += std::fabs(double(a[c]) * b[c]);
      dot += double(a[c]) * b[c];
    }
    REQUIRE(std::fabs(fused_dot(a, b) - dot) <= gamma<float>(3) * sizes);
  }
}

// Catches: a difference of products that loses more than two units in the last place to cancellation.
TEST_CASE("difference_of_products keeps its accuracy where the products cancel") {
  Random random(2);
  for (int k = 0; k < 200000; ++k) {
    const float a = random.uniform(0.5f, 1), b = random.uniform(0.5f, 1), c = random.uniform(0.5f, 1);
    const float d = a * b / c * (1 + random.uniform(-1, 1) * 1e-6f);
    const double exact = double(a) * b - double(c) * d;  // each product is exact in double
    const double ulp = std::ldexp(std::fabs(exact), -23);
    REQUIRE(std::fabs(difference_of_products(a, b, c, d) - exact) <= 2 * ulp);
  }
}

// Catches: is_normal letting zero, subnormal, infinite or NaN values through, or refusing the ends of the
// range.
TEST_CASE("is_normal tells normal numbers from all others") {
  using Limits = std::numeric_limits<float>;
  for (const float x : {Limits::min(), Limits::max(), 1.0f}) CHECK((is_normal(x) && is_normal(-x)));
  for (const float x :
       {0.0f, Limits::min() / 2, Limits::denorm_min(), Limits::infinity(), Limits::quiet_NaN()})
    CHECK_FALSE((is_normal(x) || is_normal(-x)));
}

// Catches: a generator that differs from the published one, is biased, or whose streams repeat each other.
TEST_CASE("random numbers are uniform, and streams differ") {
  constexpr int bins = 256, draws = 1 << 20;
  for (const std::uint64_t stream : {0ull, 1ull, 123456789ull}) {
    Random random(5, stream);
    std::vector<int> count(bins), low(bins);
    for (int k = 0; k < draws; ++k) {
      const float x = random.uniform();
      REQUIRE((x >= 0 && x < 1));
      ++count[static_cast<std::size_t>(x * bins)];
      ++low[random.bits() % bins];
    }
    for (const auto& counts : {count, low}) {
      double chi = 0;
      for (const int c : counts)
        chi += (c - draws / double(bins)) * (c - draws / double(bins)) / (draws / double(bins));
      CHECK(chi > 180);  // χ² with 255 degrees of freedom lies in 180…347 with probability 0.9998
      CHECK(chi < 347);
    }
  }
  std::set<std::uint32_t> firsts;
  for (std::uint64_t stream = 0; stream < 10000; ++stream) firsts.insert(Random(5, stream).bits());
  CHECK(firsts.size() > 9990);  // 10⁴ draws of 2³²: 0.01 equal pairs are expected
}

// Catches: a box that grows wrongly, or an empty one that is not neutral.
TEST_CASE("boxes unite, and the empty box is neutral") {
  const Box a = united(Box{}, vec3(1, 2, 3)), b{{-1, 0, 5}, {0, 4, 6}};
  CHECK(Box{}.empty());
  CHECK_FALSE(a.empty());
  const Box both = united(a, b);
  CHECK(both.lower == vec3(-1, 0, 3));
  CHECK(both.upper == vec3(1, 4, 6));
  for (const Box& same : {united(b, Box{}), united(Box{}, b)})
    CHECK((same.lower == b.lower && same.upper == b.upper));
  CHECK(Box{vec3(-3e38f), vec3(3e38f)}.centre() == vec3(0));
}
