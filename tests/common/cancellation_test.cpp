#include "common/parallel/cancellation.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "common/math/random.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
using Clock = std::chrono::steady_clock;

namespace {

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

void spin(double milliseconds) {
  const auto start = Clock::now();
  while (milliseconds_since(start) < milliseconds) {
  }
}

/// Takes a time for every index.
struct Spin {
  double milliseconds;
  std::atomic<std::size_t>* visited;
  void operator()(std::size_t) const {
    spin(milliseconds);
    ++*visited;
  }
};

/// Cancels at one index of many.
struct CancelAt {
  Cancellation* cancellation;
  std::size_t at;
  std::atomic<std::size_t>* visited;
  void operator()(std::size_t i) const {
    if (i == at) cancellation->cancel();
    ++*visited;
  }
};

struct Mark {
  std::uint8_t* marks;
  void operator()(std::size_t i) const { marks[i] = 1; }
};

/// Runs a pass within a pass and looks whether it came back without having done all.
struct Nested {
  std::atomic<std::size_t>*finished, *incomplete;
  void operator()(std::size_t) const {
    std::vector<std::uint8_t> marks(400);
    for_each(Backend::cpu, marks.size(), Mark{marks.data()}, 1);
    ++*finished;
    *incomplete += static_cast<std::size_t>(std::count(marks.begin(), marks.end(), 0));
  }
};

struct Throw {
  void operator()(std::size_t i) const {
    if (i == 77) throw std::runtime_error("index 77");
  }
};

/// Cancels after a random time of at most `most` ms, from a thread of its own, and waits for that at the end.
class CancelLater {
 public:
  CancelLater(Cancellation& cancellation, double milliseconds)
      : thread_([&cancellation, milliseconds] {
          spin(milliseconds);
          cancellation.cancel();
        }) {}
  ~CancelLater() { thread_.join(); }
  CancelLater(const CancelLater&) = delete;
  CancelLater& operator=(const CancelLater&) = delete;

 private:
  std::thread thread_;
};

}  // namespace

// Catches: a pass that goes on to its end, or by the large parts into which the range is cut for the threads
// (n/256 here: 400 ms), rather than by batches. The limit is a hundred batches: others may use the machine.
TEST_CASE("a pass of batches of a millisecond ends soon after it is cancelled") {
  std::vector<double> latencies;
  for (int k = 0; k < 15; ++k) {
    Cancellation cancellation;
    std::atomic<std::size_t> visited{0};
    Clock::time_point cancelled;
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(10 + k));
      cancelled = Clock::now();
      cancellation.cancel();
    });
    CHECK_FALSE(cancellation.run([&] { for_each(Backend::cpu, 100000, Spin{1, &visited}, 1); }));
    const auto ended = Clock::now();
    other.join();
    latencies.push_back(std::chrono::duration<double, std::milli>(ended - cancelled).count());
    CHECK(visited > 0);
    CHECK(visited < 100000);
  }
  std::sort(latencies.begin(), latencies.end());
  std::printf("  from cancel() to the end of run(): median %.2f ms, largest %.2f ms\n", latencies[7],
              latencies[14]);
#if !defined(__SANITIZE_ADDRESS__)
  CHECK(latencies[7] < 100);
#endif
}

// Catches: a cancelled pass that returns as if it were done; passes of any size and algorithms that run on.
TEST_CASE("nothing that follows a cancelled pass runs") {
  for (const std::size_t at : {0u, 1u, 5000u, 99999u}) {
    Cancellation cancellation;
    std::atomic<std::size_t> visited{0}, after{0};
    bool went_on = false;
    CHECK_FALSE(cancellation.run([&] {
      for_each(Backend::cpu, 100000, CancelAt{&cancellation, at, &visited}, 10);
      went_on = true;
      for_each(Backend::cpu, 100, Spin{0, &after});
    }));
    CHECK_FALSE(went_on);
    CHECK(visited > 0);
    CHECK(after == 0);
    CHECK(cancellation.cancelled());
    CHECK_FALSE(cancellation.run([&] { went_on = true; }));
    CHECK_FALSE(went_on);
  }
  Cancellation cancellation;
  bool ended = false;
  CHECK_FALSE(cancellation.run([&] {
    CHECK_FALSE(is_cancelled());
    CHECK_NOTHROW(stop_if_cancelled());
    cancellation.cancel();
    CHECK(is_cancelled());
    CHECK_THROWS_AS(stop_if_cancelled(), Cancelled);
    const Stream cpu(Backend::cpu);
    std::atomic<std::size_t> visited{0};
    for (const std::size_t n : {0u, 1u, 100000u})
      CHECK_THROWS_AS(for_each(cpu, n, Spin{0, &visited}), Cancelled);
    CHECK(visited == 0);
    for (const std::size_t n : {1u, 100000u}) {
      std::vector<std::uint32_t> a(n, 1), b(n, 1);
      std::vector<std::uint64_t> wide(n, 1);
      const std::vector<std::uint8_t> flags(n, 1);
      CHECK_THROWS_AS(reduce(cpu, a.data(), n, 0u, Sum{}), Cancelled);
      CHECK_THROWS_AS(exclusive_scan(cpu, a.data(), b.data(), n), Cancelled);
      CHECK_THROWS_AS(exclusive_scan(cpu, wide.data(), wide.data(), n), Cancelled);
      CHECK_THROWS_AS(sort_by_key(cpu, a.data(), b.data(), n), Cancelled);
      CHECK_THROWS_AS(sort_by_key(cpu, wide.data(), b.data(), n), Cancelled);
      CHECK_THROWS_AS(compact(cpu, flags.data(), n, b.data()), Cancelled);
    }
    ended = true;
  }));
  CHECK(ended);  // work that ends all the same was cancelled nevertheless
}

// Catches: an algorithm that is cancelled midway, and returns what it has so far.
TEST_CASE("an algorithm ends whole or not at all") {
  const std::size_t n = 1 << 20;
  const std::vector<std::uint32_t> values(n, 3);
  const std::vector<std::uint8_t> flags(n, 1);
  std::vector<std::uint32_t> sums(n), indices(n);
  int whole = 0, cut = 0, wrong = 0;
  const auto round = [&] {
    wrong += reduce(Backend::cpu, values.data(), n, 0u, Sum{}) != 3 * n;
    exclusive_scan(Backend::cpu, values.data(), sums.data(), n);
    wrong += sums[n - 1] != 3 * (n - 1) || sums[n / 2] != 3 * (n / 2);
    wrong += compact(Backend::cpu, flags.data(), n, indices.data()) != n || indices[n - 1] != n - 1;
  };
  round();  // the first is slow
  Timer timer(Backend::cpu);
  round();
  const double round_ms = timer.milliseconds();  // of this machine, and of what it is compiled with
  for (int k = 0; k < 300; ++k) {
    Random random(1, static_cast<std::uint64_t>(k));
    Cancellation cancellation;
    std::fill(sums.begin(), sums.end(), 0);
    std::fill(indices.begin(), indices.end(), 0);
    const CancelLater later(cancellation, random.uniform(0, 3 * round_ms));
    cancellation.run([&] {
      ++cut;
      for (;;) {
        round();
        ++whole;
      }
    });
    REQUIRE(wrong == 0);
  }
  CHECK(cut > 100);
  CHECK(whole > 0);
}

// Catches: cancelling that reaches passes of other threads, or those that come later on the same thread.
TEST_CASE("cancelling has no effect on work outside") {
  CHECK_FALSE(is_cancelled());
  std::atomic<bool> stop{false};
  std::atomic<std::size_t> wrong{0}, passes{0};
  std::thread other([&] {
    while (!stop) {
      std::atomic<std::size_t> visited{0};
      try {
        for_each(Backend::cpu, 1000, Spin{0, &visited}, 10);
        stop_if_cancelled();
      } catch (const Cancelled&) {
        ++wrong;
      }
      wrong += visited != 1000;
      ++passes;
    }
  });
  for (int k = 0; k < 1000; ++k) {
    Cancellation cancellation;
    std::atomic<std::size_t> visited{0};
    cancellation.run([&] {
      for_each(Backend::cpu, 100000, CancelAt{&cancellation, std::size_t(k), &visited}, 1);
    });
    CHECK_FALSE(is_cancelled());
    std::vector<std::uint8_t> marks(1000);
    for_each(Backend::cpu, marks.size(), Mark{marks.data()}, 10);
    REQUIRE(std::count(marks.begin(), marks.end(), 1) == 1000);
  }
  stop = true;
  other.join();
  CHECK(wrong == 0);
  CHECK(passes > 0);
}

// Catches: a pass within a pass that was cut short and returns as if it were done.
TEST_CASE("a pass within a cancelled pass ends whole or by Cancelled") {
  std::size_t all = 0;
  for (int k = 0; k < 2000; ++k) {
    Random random(2, static_cast<std::uint64_t>(k));
    Cancellation cancellation;
    std::atomic<std::size_t> finished{0}, incomplete{0};
    const CancelLater later(cancellation, random.uniform(0, 0.3f));
    cancellation.run([&] {
      for (;;) for_each(Backend::cpu, 64, Nested{&finished, &incomplete}, 1);
    });
    REQUIRE(incomplete == 0);
    all += finished;
  }
  CHECK(all > 1000);
}

// Catches: exceptions of the work that are swallowed or taken for a cancellation, and a state that they
// spoil.
TEST_CASE("other exceptions pass") {
  Cancellation cancellation;
  CHECK_THROWS_WITH(cancellation.run([] { throw std::runtime_error("plain"); }), "plain");
  CHECK_THROWS_WITH(cancellation.run([] { for_each(Backend::cpu, 1000, Throw{}, 1); }), "index 77");
  CHECK_THROWS_AS(cancellation.run([] { throw Cancelled{}; }), Cancelled);  // nobody cancelled this
  CHECK_FALSE(cancellation.cancelled());
  std::atomic<std::size_t> visited{0};
  CHECK(cancellation.run([&] { for_each(Backend::cpu, 1000, Spin{0, &visited}, 1); }));
  CHECK(visited == 1000);
  CHECK_THROWS_AS(cancellation.run([&] { cancellation.run([] {}); }), std::logic_error);
  CHECK(cancellation.run([] {}));
}

// Catches: work within work that does not end with it, or that ends it.
TEST_CASE("a cancellation reaches what runs within, not what runs around") {
  for (int k = 0; k < 200; ++k) {
    Cancellation outer, inner;
    std::atomic<std::size_t> visited{0};
    bool inner_went_on = false, outer_went_on = false;
    CHECK_FALSE(outer.run([&] {
      inner.run([&] {
        for_each(Backend::cpu, 100000, CancelAt{&outer, 100, &visited}, 1);
        inner_went_on = true;
      });
      outer_went_on = true;
    }));
    CHECK_FALSE(inner_went_on);
    CHECK_FALSE(outer_went_on);
    CHECK_FALSE(inner.cancelled());
    CHECK(visited < 100000);
  }
  Cancellation outer, inner;
  std::atomic<std::size_t> visited{0}, after{0};
  CHECK(outer.run([&] {
    CHECK_FALSE(inner.run([&] { for_each(Backend::cpu, 100000, CancelAt{&inner, 100, &visited}, 1); }));
    for_each(Backend::cpu, 1000, Spin{0, &after});
  }));
  CHECK(visited < 100000);
  CHECK(after == 1000);
}

// Catches: a cancel() that is lost because it came just before, at the beginning or at the end of the work;
// crashes and hangs. Work that nobody stops would go on for ten seconds, and be counted.
TEST_CASE("ten thousand cancels at any moment, none is lost") {
  std::size_t lost = 0, before = 0, passes = 0;
  const auto trial = [&](std::uint64_t k) {
    Random random(3, k);
    Cancellation cancellation;
    const CancelLater first(cancellation, random.uniform(0, 0.1f));
    if (k % 4 == 0) cancellation.run([] {});  // it may run twice
    if (k % 16 == 1) spin(0.2);               // and be cancelled beforehand
    bool begun = false;
    const bool done = cancellation.run([&] {
      begun = true;
      const auto start = Clock::now();
      while (milliseconds_since(start) < 10000) {
        std::vector<std::uint8_t> marks(300);
        for_each(Backend::cpu, marks.size(), Mark{marks.data()}, 16);
        lost += std::count(marks.begin(), marks.end(), 0) > 0;
        ++passes;
      }
      ++lost;
    });
    before += !begun;
    lost += done;
  };
  for (std::uint64_t k = 0; k < 5000; ++k) trial(k);
  Cancellation around;  // and as a part of other work, where task groups are tied to each other
  CHECK(around.run([&] {
    for (std::uint64_t k = 5000; k < 10000; ++k) trial(k);
  }));
  std::printf("  %zu passes, %zu cancelled before they began\n", passes, before);
  CHECK(lost == 0);
  CHECK(before > 0);
  CHECK(passes > 10000);
}

// Catches: cancel() from many threads at once, or again and again, that is not safe.
TEST_CASE("threads may hammer at cancel()") {
  for (std::uint64_t k = 0; k < 500; ++k) {
    Random random(4, k);
    Cancellation cancellation;
    std::atomic<bool> stop{false};
    std::vector<std::thread> others;
    const double wait = random.uniform(0, 0.2f);
    for (int t = 0; t < 3; ++t)
      others.emplace_back([&] {
        spin(wait);
        do cancellation.cancel();
        while (!stop);
      });
    std::atomic<std::size_t> visited{0};
    for (int turn = 0; turn < 5; ++turn)
      while (cancellation.run([&] { for_each(Backend::cpu, 1000, Spin{0, &visited}, 1); })) {
      }
    CHECK(cancellation.cancelled());
    stop = true;
    for (std::thread& other : others) other.join();
  }
}
