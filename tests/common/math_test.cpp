#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "common/math/box.h"
#include "common/math/precision.h"
#include "common/math/random.h"
#include "common/math/statistics.h"
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

// ---- statistics ----

namespace {

/// A standard normal variable (Box & Muller 1958).
double normal(Random& random) {
  const double u = 1 - random.uniform_double(), v = random.uniform_double();
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * pi * v);
}

}  // namespace

// Catches: a rank that is off by one, a quantile that is not interpolated, or that makes NaN of infinities.
TEST_CASE("quantiles of sets made by hand") {
  const std::vector<double> five = {1, 2, 4, 8, 16};
  CHECK(quantile(five, 0) == 1);
  CHECK(quantile(five, 0.5) == 4);
  CHECK(quantile(five, 1) == 16);
  CHECK(quantile(five, 0.25) == 2);
  CHECK(quantile(five, 0.125) == 1.5);  // rank 0.125·4 = 0.5
  CHECK(quantile(five, 0.9) == Approx(8 + 0.6 * 8));
  CHECK(quantile({3}, 0.7) == 3);
  CHECK(std::isnan(quantile({}, 0.5)));
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK(quantile({1, infinity, infinity}, 0.75) == infinity);
  const Quartiles q = quartiles({7, 1, 3, 5});  // sorted first: ranks 0.75, 1.5, 2.25
  CHECK(q.q1 == 2.5);
  CHECK(q.median == 4);
  CHECK(q.q3 == 5.5);
}

// Catches: Wald's interval, which is empty at 0 and 1, in place of Wilson's; a continuity correction. The
// values are those of Newcombe 1998, table I, method 3.
TEST_CASE("proportions have Wilson's intervals as published") {
  const struct {
    double k, n, low, high;
  } published[] = {
      {81, 263, 0.2553, 0.3662}, {15, 148, 0.0624, 0.1605}, {0, 20, 0, 0.1611}, {1, 29, 0.0061, 0.1718}};
  for (const auto& p : published) {
    const Estimate seen = proportion(p.k, p.n), missed = proportion(p.n - p.k, p.n);
    INFO(p.k << " of " << p.n);
    CHECK(seen.value == p.k / p.n);
    CHECK(seen.low == Approx(p.low).margin(5e-5));
    CHECK(seen.high == Approx(p.high).margin(5e-5));
    CHECK(missed.low ==
          Approx(1 - seen.high).margin(1e-12));  // what happens and what does not mirror each other
    CHECK(missed.high == Approx(1 - seen.low).margin(1e-12));
  }
  CHECK(proportion(0, 20).low == 0);
  CHECK(proportion(20, 20).high == 1);
  CHECK(std::isnan(proportion(0, 0).value));
  CHECK(proportion(0, 0).high == 1);
}

// Catches: the variance of a population taken for that of a sample, an interval that does not cover,
// cancellation that makes a variance negative.
TEST_CASE("means have intervals that cover the truth as often as they say") {
  const Estimate four = mean_estimate(1 + 2 + 3 + 6, 1 + 4 + 9 + 36, 4);  // variance (4 + 1 + 0 + 9)/3
  CHECK(four.value == 3);
  CHECK(four.high == Approx(3 + 1.959964 * std::sqrt(14.0 / 3 / 4)));
  CHECK(four.low == Approx(3 - 1.959964 * std::sqrt(14.0 / 3 / 4)));
  CHECK(mean_estimate(2, 4, 1).high == std::numeric_limits<double>::infinity());
  const Estimate same = mean_estimate(3 * 0.1, 3 * (0.1 * 0.1), 3);
  CHECK(same.low <= same.high);
  // Of 2000 trials at 95 %, 1862 to 1934 cover with a probability of 0.9998 (binomial).
  Random random(11);
  int covered = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    double sum = 0, squares = 0;
    for (int k = 0; k < 500; ++k) {
      const double x = 5 + 2 * normal(random);
      sum += x, squares += x * x;
    }
    const Estimate mean = mean_estimate(sum, squares, 500);
    covered += mean.low <= 5 && 5 <= mean.high;
  }
  CHECK(covered >= 1862);
  CHECK(covered <= 1934);
}

// Catches: ranks that are off by one, so that the interval covers too rarely; an interval that takes the
// values for normal. How often order statistics hold the median, the binomial distribution says: of 25 values
// the 8th and the 19th with 0.971, of 100 the 41st and the 61st with 0.954. So of 2000 trials 1912 to 1968,
// and 1871 to 1941, cover with a probability of 0.9998.
TEST_CASE("medians have intervals that cover the truth whatever the distribution") {
  const struct { int n, least, most; } cases[] = {{25, 1912, 1968}, {100, 1871, 1941}};
  for (const auto& c : cases) {
    Random random(12);
    int covered = 0;
    for (int trial = 0; trial < 2000; ++trial) {
      std::vector<double> values;
      for (int k = 0; k < c.n; ++k) values.push_back(-std::log(1 - random.uniform_double()));  // median log 2
      std::sort(values.begin(), values.end());
      const Estimate median = quantile_estimate(values, 0.5);
      CHECK(median.value == quartiles(values).median);
      covered += median.low <= std::log(2.0) && std::log(2.0) <= median.high;
    }
    INFO(c.n << " values, " << covered);
    CHECK(covered >= c.least);
    CHECK(covered <= c.most);
  }
  std::vector<double> ranks;
  for (int k = 1; k <= 25; ++k) ranks.push_back(k);
  CHECK(quantile_estimate(ranks, 0.5).low == 8);
  CHECK(quantile_estimate(ranks, 0.5).high == 19);
  // of 25 values none is above the 99th percentile with 95 % confidence
  CHECK(quantile_estimate(ranks, 0.99).high == std::numeric_limits<double>::infinity());
  CHECK(quantile_estimate(ranks, 0.01).low == -std::numeric_limits<double>::infinity());
}
