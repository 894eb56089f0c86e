#include "common/app/worker.h"

#include <tbb/task_arena.h>

#if defined(__linux__)
#include <sys/resource.h>
#include <unistd.h>
#endif

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "common/parallel/cancellation.h"

namespace trilha {

void lower_priority() {
#if defined(__linux__)
  constexpr int nice = 10;
  const auto thread = static_cast<id_t>(gettid());
  if (getpriority(PRIO_PROCESS, thread) < nice) setpriority(PRIO_PROCESS, thread, nice);
#endif
}

struct Worker::State {
  struct Job {
    int key;
    std::function<void()> work;
  };
  std::mutex mutex;
  std::condition_variable wake;
  std::deque<Job> waiting;
  Cancellation* current = nullptr;  ///< under way
  bool stop = false;
  std::thread thread{[this] { run(); }};  // the last: it uses the others

  void run() {
    lower_priority();
    tbb::task_arena alone(1);  // oneTBB's other threads have better things to do
    std::unique_lock lock(mutex);
    for (;;) {
      wake.wait(lock, [&] { return stop || !waiting.empty(); });
      if (stop) return;
      std::function<void()> work = std::move(waiting.front().work);
      waiting.pop_front();
      Cancellation cancellation;
      current = &cancellation;
      lock.unlock();
      try {
        alone.execute([&] { cancellation.run(work); });
      } catch (...) {  // memory was short: what was to be measured stays unmeasured
      }
      work = nullptr;  // what it holds is let go of here, not when the next job comes
      lock.lock();
      current = nullptr;
    }
  }
};

Worker::Worker() : state_(std::make_unique<State>()) {}

Worker::~Worker() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->stop = true;
  }
  end_all();
  state_->wake.notify_all();
  state_->thread.join();
}

void Worker::end_all() {
  std::deque<State::Job> dropped;  // after the lock is open again
  const std::lock_guard lock(state_->mutex);
  dropped.swap(state_->waiting);
  if (state_->current) state_->current->cancel();
}

void Worker::post(int key, std::size_t most, std::function<void()> job) {
  State::Job dropped{};  // after the lock is open again
  {
    const std::lock_guard lock(state_->mutex);
    const auto of_key = [&](const State::Job& other) { return other.key == key; };
    auto& waiting = state_->waiting;
    if (static_cast<std::size_t>(std::count_if(waiting.begin(), waiting.end(), of_key)) >= most) {
      const auto oldest = std::find_if(waiting.begin(), waiting.end(), of_key);
      dropped = std::move(*oldest);
      waiting.erase(oldest);
    }
    waiting.push_back({key, std::move(job)});
  }
  state_->wake.notify_all();
}

}  // namespace trilha
