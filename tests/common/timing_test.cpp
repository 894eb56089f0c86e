#include <algorithm>
#include <chrono>
#include <functional>

#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"
#include "tests/random_values.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

constexpr std::size_t n = 1000000;

struct Square {
  const std::uint32_t* in;
  std::uint32_t* out;
  TRILHA_HD void operator()(std::size_t i) const { out[i] = in[i] * in[i]; }
};

double milliseconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

// Catches: a primitive that costs more than the loop it replaces. On a busy machine a turn can be slow, so
// the best of many counts, what is compared takes turns, and a primitive that seems slow has many more.
TEST_CASE("on the CPU no primitive is slower than a serial loop at 10^6 elements") {
  require_meaningful_times();
  const auto values = random_values<std::uint32_t>(n, 1, 0xffffffffu);
  const auto flags = random_values<std::uint8_t>(n, 2, 2);
  std::vector<std::uint32_t> out(n), keys(n), payload(n);
  struct Item {
    std::uint32_t key, value;
  };
  std::vector<Item> items(n);
  std::uint32_t sink = 0;
  const struct {
    const char* name;
    int turns;
    std::function<void()> ours, serial;
  } rows[] = {
      {"for_each", 60,
       [&] {
         for_each(Backend::cpu, n, Square{values.data(), out.data()}, 1 << 15);
       },
       [&] {
         for (std::size_t i = 0; i < n; ++i) out[i] = values[i] * values[i];
       }},
      {"reduce", 60, [&] { sink += reduce(Backend::cpu, values.data(), n, 0u, Sum{}); },
       [&] {
         for (std::size_t i = 0; i < n; ++i) sink += values[i];
       }},
      {"exclusive_scan", 60, [&] { exclusive_scan(Backend::cpu, values.data(), out.data(), n); },
       [&] {
         std::uint32_t sum = 0;
         for (std::size_t i = 0; i < n; ++i) out[i] = sum, sum += values[i];
       }},
      {"sort_by_key", 5,
       [&] {
         keys = values;
         sort_by_key(Backend::cpu, keys.data(), payload.data(), n);
       },
       [&] {
         for (std::size_t i = 0; i < n; ++i) items[i] = {values[i], payload[i]};
         std::stable_sort(items.begin(), items.end(),
                          [](const Item& a, const Item& b) { return a.key < b.key; });
         for (std::size_t i = 0; i < n; ++i) keys[i] = items[i].key, payload[i] = items[i].value;
       }},
      {"compact", 60,
       [&] { sink += static_cast<std::uint32_t>(compact(Backend::cpu, flags.data(), n, out.data())); },
       [&] {
         std::uint32_t count = 0;
         for (std::size_t i = 0; i < n; ++i)
           if (flags[i] != 0) out[count++] = static_cast<std::uint32_t>(i);
         sink += count;
       }},
  };
  for (const auto& row : rows) {
    double ours = 1e300, serial = 1e300;
    for (int turn = 0; turn < row.turns || (ours > 1.1 * serial && turn < 50 * row.turns); ++turn) {
      ours = std::min(ours, milliseconds(row.ours));
      serial = std::min(serial, milliseconds(row.serial));
    }
    std::printf("  %-16s %.3f ms, serial %.3f ms, ratio %.2f\n", row.name, ours, serial, ours / serial);
    CHECK(ours <= 1.1 * serial);  // a tenth for a machine that is never quiet
  }
  CHECK(sink != 1);
}
