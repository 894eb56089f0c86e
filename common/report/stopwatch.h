#pragma once
// Times that can be compared: everything that is compared takes turns.

#include <functional>
#include <vector>

#include "common/parallel/backend.h"

namespace trilha {

/// The median and quartiles of repeated measurements, in milliseconds.
struct Times {
  double median = 0, q1 = 0, q3 = 0;
  int repeats = 0;
};

Times summary(const std::vector<double>& ms);

/// How pieces of work are timed against each other.
struct Turns {
  int repeats = 21;      ///< measurements of each piece
  double least_ms = 10;  ///< a measurement is as many runs as take about so long, by the warm-up
  /// After the fifth repeat no turn begins once the turns have taken so long.
  double most_ms = 1e300;
  /// Asked before each measurement; false ends the turns early.
  std::function<bool()> keep_going = [] { return true; };
};

/// The time of one run of each piece of work on the stream. Every piece is run twice to warm up; the second
/// shows how many runs make a measurement. Then they take turns, so that whatever slows the machine for a
/// while slows all of them, and each turn starts one piece further. Device work is timed by events. Fewer
/// repeats than asked for mean that it was stopped.
std::vector<Times> take_turns(const Stream& stream, const std::vector<std::function<void()>>& work,
                              const Turns& turns = {});

}  // namespace trilha
