#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

#include "common/parallel/backend.h"

namespace trilha {

/// Does body(begin, end) over [0, n) in bands, one after the other, each sized so that it should take about
/// `target_ms` by the speed of those before: short enough for a display driver's watchdog, for a progress bar
/// and for stopping, long enough to fill the machine. The first band is `first` long, none is longer than
/// `most`. After each, keep_going(fraction done) decides whether to go on. Returns false if it was told to
/// stop.
template <class Body>
bool for_each_band(const Stream& stream, std::size_t n, std::size_t first, std::size_t most, double target_ms,
                   const Body& body, const std::function<bool(double)>& keep_going) {
  std::size_t length = std::clamp<std::size_t>(first, 1, most);
  for (std::size_t begin = 0; begin < n;) {
    const std::size_t end = std::min(n, begin + std::min(length, n - begin));
    Timer timer(stream);
    body(begin, end);
    const double ms = timer.milliseconds();
    const double wanted = static_cast<double>(end - begin) * target_ms / std::max(ms, 1e-3);
    const double limit = std::min(8.0 * static_cast<double>(length), static_cast<double>(most));
    length = static_cast<std::size_t>(std::clamp(wanted, 1.0, limit));
    begin = end;
    if (!keep_going(static_cast<double>(end) / static_cast<double>(n)) && end < n) return false;
  }
  return true;
}

}  // namespace trilha
