#pragma once
// Work that another thread may end: what a window needs, where a change makes the work under way useless.

#include <functional>
#include <memory>

namespace trilha {

/// Thrown by a pass or an algorithm (for_each, reduce, …) in work that was cancelled. What it was to write
/// is not to be read. It is no error, and so no std::exception; only Cancellation::run catches it.
struct Cancelled {};

/// One piece of work that may be cancelled once, for good.
class Cancellation {
 public:
  Cancellation();
  ~Cancellation();
  Cancellation(const Cancellation&) = delete;
  Cancellation& operator=(const Cancellation&) = delete;

  /// Runs the work on this thread. Returns false if it was cancelled, before or meanwhile: it has then not
  /// begun, left by Cancelled, or ended all the same. Other exceptions pass, unless the work was cancelled
  /// before they were thrown. If this is itself part of work that is cancelled, Cancelled passes. Throws
  /// std::logic_error if it is running already.
  bool run(const std::function<void()>& work);

  /// Ends the work soon, from any thread: on the CPU no further batch of a pass begins, on a device no
  /// further pass. Returns at once.
  void cancel();
  bool cancelled() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Is this thread at work that was cancelled? For long loops inside a batch, which then return; some ten
/// nanoseconds.
bool is_cancelled();
/// Throws Cancelled if so. For work between passes; what runs inside a pass asks is_cancelled().
void stop_if_cancelled();

}  // namespace trilha
