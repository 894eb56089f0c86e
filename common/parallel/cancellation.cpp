#include "common/parallel/cancellation.h"

#include <tbb/task_group.h>

#include <atomic>

namespace trilha {

/// oneTBB's task group: all parallel loops within its tasks belong to it, and end with it.
struct Cancellation::State {
  tbb::task_group group;
  std::atomic<bool> cancelled{false};
};

Cancellation::Cancellation() : state_(std::make_unique<State>()) {}
Cancellation::~Cancellation() = default;

bool Cancellation::run(const std::function<void()>& work) {
  try {
    if (!cancelled()) state_->group.run_and_wait(work);
  } catch (const Cancelled&) {
  }
  return !cancelled();
}

void Cancellation::cancel() {
  state_->cancelled = true;
  state_->group.cancel();
}

bool Cancellation::cancelled() const { return state_->cancelled; }

bool is_cancelled() { return tbb::is_current_task_group_canceling(); }

void stop_if_cancelled() {
  if (is_cancelled()) throw Cancelled{};
}

}  // namespace trilha
