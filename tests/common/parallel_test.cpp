#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/math/random.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/bands.h"
#include "common/parallel/buffer.h"
#include "common/parallel/for_each.h"
#include "tests/random_values.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// Sizes at which blocks, warps and tasks end, and random ones between.
std::vector<std::size_t> sizes() {
  std::vector<std::size_t> result{0, 1, 2, 31, 32, 33, 255, 256, 257, 1023, 1025, 32767, 65537, 1000003};
  Random random(1);
  for (int k = 0; k < 6; ++k) result.push_back(random.index(300000));
  return result;
}

struct Fuse {
  float a, c;
  float* out;
  TRILHA_HD void operator()(std::size_t) const {
    out[0] = a * a + c;
    out[1] = fma(a, a, c);
  }
};

struct Square {
  const std::uint32_t* in;
  std::uint32_t* out;
  TRILHA_HD void operator()(std::size_t i) const { out[i] = in[i] * in[i]; }
};

/// Marks the index, relative to a base beyond 2³², and writes wrong numbers where the index was cut to 32
/// bits.
struct MarkFar {
  std::size_t base;
  std::uint8_t* marks;
  TRILHA_HD void operator()(std::size_t i) const {
    if (i >= base) ++marks[i - base];
  }
};

/// Counts indices into a byte a 2²⁰ of them; only the multiples of 2²⁰ write.
struct MarkMultiples {
  std::uint8_t* marks;
  TRILHA_HD void operator()(std::size_t i) const {
    if (i % (std::size_t{1} << 20) == 0) ++marks[i >> 20];
  }
};

}  // namespace

// Catches: arithmetic that a compiler fused, on either machine: a·a + c with and without fma differs here.
TEST_CASE("nothing is fused but what the code fuses, in passes too") {
  const float a = 1.0f + 0x1p-12f, c = -(1.0f + 0x1p-11f);  // a·a = 1 + 2⁻¹¹ + 2⁻²⁴, which rounds to −c
  for (const Backend backend : backends()) {
    Buffer<float> out(backend, 2);
    for_each(backend, 1, Fuse{a, c, out.data()});
    CHECK(out.to_vector(backend) == std::vector<float>{0.0f, 0x1p-24f});
  }
}

// Catches: an index skipped, done twice, or written to the wrong place.
TEST_CASE("for_each visits every index once") {
  for (const Backend backend : backends())
    for (const std::size_t n : sizes()) {
      const auto values = random_values<std::uint32_t>(n, n, 60000);
      const Buffer<std::uint32_t> in(backend, values);
      Buffer<std::uint32_t> out(backend, n);
      for_each(backend, n, Square{in.data(), out.data()});
      const auto result = out.to_vector(backend);
      INFO(n << " on " << name(backend));
      REQUIRE(std::equal(values.begin(), values.end(), result.begin(),
                         [](auto a, auto b) { return a * a == b; }));
    }
}

// Catches: indices held in 32 bits, signed or not.
TEST_CASE("for_each counts beyond 2^31 and 2^32", "[large]") {
  for (const Backend backend : backends()) {
    for (const std::size_t base :
         {(std::size_t{1} << 31) - 3, (std::size_t{1} << 32) - 3, std::size_t{1} << 40}) {
      Buffer<std::uint8_t> marks(backend, 1000);
      fill_bytes(backend, marks.data(), 0, marks.bytes());
      for_each(backend, {base, base + 1000}, MarkFar{base, marks.data()});
      const auto result = marks.to_vector(backend);
      CHECK(std::count(result.begin(), result.end(), 1) == 1000);
    }
    const std::size_t n = (std::size_t{1} << 31) + (std::size_t{1} << 21);
    Buffer<std::uint8_t> marks(backend, n >> 20);
    fill_bytes(backend, marks.data(), 0, marks.bytes());
    for_each(backend, n, MarkMultiples{marks.data()});
    const auto result = marks.to_vector(backend);
    CHECK(std::count(result.begin(), result.end(), 1) == static_cast<std::ptrdiff_t>(n >> 20));
  }
}

// Catches: elements left out at block ends, a start value lost or taken twice, a wrong neutral element.
TEST_CASE("reduce is the standard library's accumulate") {
  for (const Backend backend : backends())
    for (const std::size_t n : sizes()) {
      INFO(n << " on " << name(backend));
      const auto values = random_values<std::uint32_t>(n, n + 1, 0xffffffffu);
      const Buffer<std::uint32_t> data(backend, values);
      CHECK(reduce(backend, data.data(), n, std::uint32_t{0}, Sum{}) ==
            std::accumulate(values.begin(), values.end(), std::uint32_t{0}));
      std::uint32_t lowest = 4000000000u, highest = 5;
      for (const std::uint32_t value : values)
        lowest = std::min(lowest, value), highest = std::max(highest, value);
      CHECK(reduce(backend, data.data(), n, 4000000000u, Minimum{}) == lowest);
      CHECK(reduce(backend, data.data(), n, 5u, Maximum{}) == highest);

      const std::vector<std::uint64_t> wide(values.begin(), values.end());
      const Buffer<std::uint64_t> wide_data(backend, wide);
      CHECK(reduce(backend, wide_data.data(), n, std::uint64_t{0}, Sum{}) ==
            std::accumulate(wide.begin(), wide.end(), std::uint64_t{0}));

      std::vector<float> floats(values.begin(), values.end());
      const Buffer<float> float_data(backend, floats);
      const double sum = std::accumulate(floats.begin(), floats.end(), 0.0);
      CHECK(reduce(backend, float_data.data(), n, 0.0f, Sum{}) ==
            Approx(sum).epsilon(1e-5));  // log₂ n roundings
      CHECK(reduce(backend, float_data.data(), n, 1e30f, Minimum{}) ==
            std::accumulate(floats.begin(), floats.end(), 1e30f, Minimum{}));

      std::vector<Box> boxes(n);
      Box all;
      for (std::size_t i = 0; i < n; ++i) {
        const auto x = static_cast<float>(values[i] % 1000), y = static_cast<float>(values[i] % 777);
        boxes[i] = i % 5 == 0 ? Box{} : Box{{x, y, -x}, {x + 1, y + 2, -x + 3}};  // some are empty
        all = united(all, boxes[i]);
      }
      const Buffer<Box> box_data(backend, boxes);
      const Box result = reduce(backend, box_data.data(), n, Box{}, United{});
      CHECK(result.lower == all.lower);
      CHECK(result.upper == all.upper);
    }
}

// Catches: blocks joined with the wrong sum, an inclusive scan, trouble in place.
TEST_CASE("exclusive_scan is the standard library's") {
  for (const Backend backend : backends())
    for (const std::size_t n : sizes()) {
      INFO(n << " on " << name(backend));
      const auto values = random_values<std::uint32_t>(n, n + 2, 0xffffffffu);  // sums wrap round
      std::vector<std::uint32_t> expected(n);
      std::exclusive_scan(values.begin(), values.end(), expected.begin(), std::uint32_t{0});
      Buffer<std::uint32_t> data(backend, values);
      Buffer<std::uint32_t> sums(backend, n);
      exclusive_scan(backend, data.data(), sums.data(), n);
      REQUIRE(sums.to_vector(backend) == expected);
      exclusive_scan(backend, data.data(), data.data(), n);
      REQUIRE(data.to_vector(backend) == expected);

      const std::vector<std::uint64_t> wide(values.begin(), values.end());
      std::vector<std::uint64_t> wide_expected(n);
      std::exclusive_scan(wide.begin(), wide.end(), wide_expected.begin(), std::uint64_t{0});
      Buffer<std::uint64_t> wide_data(backend, wide);
      exclusive_scan(backend, wide_data.data(), wide_data.data(), n);
      REQUIRE(wide_data.to_vector(backend) == wide_expected);
    }
}

// Catches: an unstable or wrong order, values parted from their keys, key bits that are not looked at.
TEMPLATE_TEST_CASE("sort_by_key is the standard library's stable_sort", "", std::uint32_t, std::uint64_t) {
  for (const Backend backend : backends())
    for (const std::size_t n : sizes())
      for (const std::uint32_t below : {3u, 1u << 30, 0xffffffffu}) {
        INFO(n << " keys below " << below << " on " << name(backend));
        auto keys = random_values<TestType>(n, n + below, below);
        if constexpr (sizeof(TestType) == 8)
          for (TestType& key : keys) key |= key << 32;  // high halves count, too
        std::vector<std::uint32_t> order(n);
        std::iota(order.begin(), order.end(), 0);
        Buffer<TestType> key_data(backend, keys);
        Buffer<std::uint32_t> value_data(backend, order);
        const int bits = sizeof(TestType) == 8 ? 64 : below == 3 ? 2 : below == 1u << 30 ? 30 : 32;
        sort_by_key(backend, key_data.data(), value_data.data(), n, bits);
        std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
        REQUIRE(value_data.to_vector(backend) == order);
        std::sort(keys.begin(), keys.end());
        REQUIRE(key_data.to_vector(backend) == keys);
      }
}

// Catches: flags other than 1 not seen, an index lost or moved, a wrong count.
TEST_CASE("compact keeps the flagged indices in order") {
  for (const Backend backend : backends())
    for (const std::size_t n : sizes())
      for (const std::uint32_t below : {1u, 2u, 256u}) {  // none set, half, nearly all
        INFO(n << " flags below " << below << " on " << name(backend));
        const auto flags = random_values<std::uint8_t>(n, n + 3, below);
        std::vector<std::uint32_t> expected;
        for (std::size_t i = 0; i < n; ++i)
          if (flags[i] != 0) expected.push_back(static_cast<std::uint32_t>(i));
        const Buffer<std::uint8_t> data(backend, flags);
        Buffer<std::uint32_t> indices(backend, n);
        REQUIRE(compact(backend, data.data(), n, indices.data()) == expected.size());
        auto result = indices.to_vector(backend);
        result.resize(expected.size());
        REQUIRE(result == expected);
      }
}

// Catches: a leak, a byte counted twice, a moved-from buffer that frees.
TEST_CASE("buffers count their bytes and move without copying") {
  for (const Backend backend : backends()) {
    const std::size_t before = live_bytes(backend);
    {
      Buffer<std::uint32_t> a(backend, 1000);
      CHECK(live_bytes(backend) == before + 4000);
      const auto* where = a.data();
      Buffer<std::uint32_t> b = std::move(a);
      CHECK(b.data() == where);
      CHECK(live_bytes(backend) == before + 4000);
      b = Buffer<std::uint32_t>(backend, 10);
      const Buffer<std::uint32_t> c = b.to(Backend::cpu, backend);
      CHECK(c.size() == 10);
    }
    CHECK(live_bytes(backend) == before);
    CHECK_THROWS_AS(Buffer<double>(backend, std::size_t{1} << 62), std::bad_alloc);
#if !defined(__SANITIZE_ADDRESS__)  // whose allocator ends the program instead
    CHECK_THROWS_AS(Buffer<double>(backend, std::size_t{1} << 50), std::bad_alloc);
#endif
    CHECK(live_bytes(backend) == before);
    Buffer<std::uint8_t> after(backend, 1);
    for_each(backend, 1, MarkFar{1, after.data()});  // what failed is not said again by the next launch
  }
}

// Catches: a band missing, overlapping or longer than allowed, a stop that is not heeded.
TEST_CASE("bands cover the range once, within their limit, and stop when told") {
  for (const std::size_t n : {0u, 1u, 7u, 1000u}) {
    std::size_t expected = 0;
    CHECK(for_each_band(
        Backend::cpu, n, 3, 20, 1e9,
        [&](std::size_t begin, std::size_t end) {
          CHECK(begin == expected);
          CHECK(end > begin);
          CHECK(end - begin <= 20);
          expected = end;
        },
        [](double) { return true; }));
    CHECK(expected == n);
  }
  int bands = 0;
  CHECK_FALSE(for_each_band(
      Backend::cpu, 100, 1, 1, 1, [&](std::size_t, std::size_t) { ++bands; },
      [&](double) { return bands < 4; }));
  CHECK(bands == 4);
}

// Catches: a pass or an algorithm that begins on a device although its work was cancelled.
TEST_CASE("nothing begins on any backend in work that was cancelled") {
  for (const Backend backend : backends()) {
    INFO(name(backend));
    const Stream stream(backend);
    const std::vector<std::uint32_t> values(1000, 3);
    const Buffer<std::uint32_t> in(stream, values);
    Buffer<std::uint32_t> out(stream, values);
    Cancellation cancellation;
    CHECK_FALSE(cancellation.run([&] {
      for_each(stream, values.size(), Square{in.data(), out.data()});
      stream.synchronize();
      cancellation.cancel();
      CHECK_THROWS_AS(for_each(stream, values.size(), Square{out.data(), out.data()}), Cancelled);
      CHECK_THROWS_AS(exclusive_scan(stream, in.data(), out.data(), values.size()), Cancelled);
      CHECK_THROWS_AS(reduce(stream, in.data(), values.size(), 0u, Sum{}), Cancelled);
    }));
    CHECK(out.to_vector(stream) == std::vector<std::uint32_t>(1000, 9));
  }
}

// Catches: CUDA asked for and absent, but not refused.
TEST_CASE("a backend that is missing is refused with a reason") {
  CHECK(why_unavailable(Backend::cpu).empty());
  if (why_unavailable(Backend::cuda).empty()) skip("there is a CUDA device");
  CHECK_THROWS_AS(Stream(Backend::cuda), DeviceError);
  CHECK_THROWS(Buffer<int>(Backend::cuda, 1));
}

namespace {
struct Fault {
  int* nowhere;
  TRILHA_HD void operator()(std::size_t i) const { nowhere[i] = 1; }
};
}  // namespace

// Catches: errors of the device that pass unseen. It spoils the device for its process: under ctest each case
// has one.
TEST_CASE("an error on the device becomes an exception that names call and place", "[fault]") {
  require_cuda();
  try {
    for_each(Backend::cuda, 100, Fault{nullptr});
    Stream(Backend::cuda).synchronize();
    FAIL("the fault was not seen");
  } catch (const std::exception& error) {
    const std::string text = error.what();
    std::printf("  %s\n", text.c_str());
    CHECK(text.find("runtime.cu:") != std::string::npos);
    CHECK(text.find("cudaStreamSynchronize") != std::string::npos);
    CHECK(text.find("cudaErrorIllegalAddress") != std::string::npos);
  }
}
