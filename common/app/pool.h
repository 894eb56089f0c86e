#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <vector>

namespace trilha {

/// Things that are dear to make, and so are used again when the last who held one has let go of it, on
/// whatever thread. One thread, the owner's, makes and destroys them: a device's memory is freed there and
/// not where a window draws.
template <class T>
class Pool : public std::enable_shared_from_this<Pool<T>> {
 public:
  /// From now on nothing comes back: what is still held is destroyed where it is let go of.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    free_.clear();
  }

  /// One that nobody holds and that `fits`, else what `make` returns. Others that nobody holds are destroyed.
  template <class Fits, class Make>
  std::shared_ptr<T> take(const Fits& fits, const Make& make) {
    std::unique_ptr<T> taken;
    {
      const std::lock_guard lock(mutex_);
      std::erase_if(free_, [&](const std::unique_ptr<T>& one) { return !fits(*one); });
      if (!free_.empty()) {
        taken = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!taken) {
      taken = std::make_unique<T>(make());
      const std::lock_guard lock(mutex_);
      free_.reserve(most_free);  // so that coming back needs no memory
    }
    const auto come_back = [pool = this->shared_from_this()](T* one) { pool->put_back(one); };
    return {taken.release(), come_back};
  }

  /// Destroys those that nobody holds but for the `kept` that came back last.
  void trim(std::size_t kept = 0) {
    const std::lock_guard lock(mutex_);
    if (free_.size() > kept) free_.erase(free_.begin(), free_.end() - static_cast<std::ptrdiff_t>(kept));
  }

 private:
  static constexpr std::size_t most_free = 16;

  void put_back(T* one) {
    std::unique_ptr<T> owned(one);
    const std::lock_guard lock(mutex_);
    if (!closed_ && free_.size() < free_.capacity()) free_.push_back(std::move(owned));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> free_;
  bool closed_ = false;
};

}  // namespace trilha
