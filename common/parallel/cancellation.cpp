#include "common/parallel/cancellation.h"

#include <tbb/task_group.h>

#include <atomic>
#include <mutex>
#include <stdexcept>

namespace trilha {

/// oneTBB's task group: all parallel loops within its task belong to it, other libraries' as well, and end
/// with it. Each run has its own, for a group stays tied to the work around its first task.
struct Cancellation::State {
  std::atomic<bool> cancelled{false};
  std::mutex mutex;
  tbb::task_group* group = nullptr;  ///< of the run under way; guarded by the mutex
};

namespace {

/// Makes a group known to cancel() for as long as it lives.
class Running {
 public:
  Running(std::mutex& mutex, tbb::task_group*& known, tbb::task_group& group) : mutex_(mutex), known_(known) {
    const std::lock_guard lock(mutex_);
    if (known_) throw std::logic_error("a Cancellation that is running is run again");
    known_ = &group;
  }
  ~Running() {
    const std::lock_guard lock(mutex_);
    known_ = nullptr;
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

 private:
  std::mutex& mutex_;
  tbb::task_group*& known_;
};

}  // namespace

Cancellation::Cancellation() : state_(std::make_unique<State>()) {}
Cancellation::~Cancellation() = default;

bool Cancellation::run(const std::function<void()>& work) {
  tbb::task_group group;
  const Running running(state_->mutex, state_->group, group);
  tbb::task_group_status status = tbb::complete;
  try {
    // A group that is cancelled before its task begins may forget it, where it is part of other work; asked
    // from within the task, the flag is right.
    status = group.run_and_wait([&] {
      if (!cancelled()) work();
    });
  } catch (const Cancelled&) {
    status = tbb::canceled;
  }
  if (status == tbb::canceled && !cancelled()) throw Cancelled{};  // the work around this one was
  return !cancelled();
}

void Cancellation::cancel() {
  state_->cancelled = true;
  const std::lock_guard lock(state_->mutex);
  if (state_->group) state_->group->cancel();
}

bool Cancellation::cancelled() const { return state_->cancelled; }

bool is_cancelled() { return tbb::is_current_task_group_canceling(); }

void stop_if_cancelled() {
  if (is_cancelled()) throw Cancelled{};
}

}  // namespace trilha
