#include "common/report/stopwatch.h"

#include <algorithm>
#include <cmath>

#include "common/math/statistics.h"

namespace trilha {

Times summary(const std::vector<double>& ms) {
  const Quartiles q = quartiles(ms);
  return {q.median, q.q1, q.q3, static_cast<int>(ms.size())};
}

std::vector<Times> take_turns(const Stream& stream, const std::vector<std::function<void()>>& work,
                              const Turns& turns) {
  const auto milliseconds = [&](std::size_t piece, int runs) {
    Timer timer(stream);
    for (int k = 0; k < runs; ++k) work[piece]();
    return timer.milliseconds() / runs;
  };
  const std::size_t n = work.size();
  std::vector<int> runs(n, 1);
  for (std::size_t i = 0; i < n && turns.keep_going(); ++i) {
    milliseconds(i, 1);  // first touches of memory and code are no part of the work
    const double once = std::max(milliseconds(i, 1), 1e-4);
    runs[i] = static_cast<int>(std::clamp(std::ceil(turns.least_ms / once), 1.0, 1e5));
  }
  std::vector<std::vector<double>> ms(n);
  Timer all(Backend::cpu);
  for (int turn = 0; turn < turns.repeats; ++turn) {
    if (turn >= 5 && all.milliseconds() > turns.most_ms) break;
    for (std::size_t k = 0; k < n; ++k) {
      if (!turns.keep_going()) break;
      const std::size_t i = (k + static_cast<std::size_t>(turn)) % n;
      ms[i].push_back(milliseconds(i, runs[i]));
    }
  }
  std::vector<Times> times;
  for (const auto& measured : ms) times.push_back(summary(measured));
  return times;
}

}  // namespace trilha
