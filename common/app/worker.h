#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace trilha {

/// Gives the calling thread less of the processors than the others of the program, where the system can: what
/// a window draws is never to wait for what it shows.
void lower_priority();

/// A thread of lowered priority that does jobs, one after the other, for a thread that may not wait for them.
class Worker {
 public:
  Worker();
  /// Ends as end_all() does, and waits for it.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Jobs run as work that can be cancelled. One that throws has no effect. At most `most` of one key wait at
  /// a time: of more, the oldest is dropped.
  void post(int key, std::size_t most, std::function<void()> job);

  /// Drops the jobs that wait and cancels the one under way.
  void end_all();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trilha
