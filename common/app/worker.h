#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <thread>

namespace trilha {

/// Gives the calling thread less of the processors than the others of the program, where the system can: what
/// a window draws is never to wait for what it shows.
void lower_priority();

/// A thread that does jobs, one after the other, for a thread that may not wait for them. Its priority is
/// lowered.
class Worker {
 public:
  /// What its destruction does about the job under way: waits for its end, or leaves it to end by itself,
  /// with what it holds. Jobs that wait are dropped.
  enum class End { wait, leave };
  explicit Worker(End end);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// A job that throws has no effect. At most `most` of one key wait at a time: of more, the oldest is
  /// dropped.
  void post(int key, std::size_t most, std::function<void()> job);

 private:
  struct State;
  std::shared_ptr<State> state_;
  End end_;
  std::thread thread_;
};

}  // namespace trilha
