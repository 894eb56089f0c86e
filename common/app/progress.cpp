#include "common/app/progress.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>

namespace trilha {
namespace {

volatile std::sig_atomic_t interrupt_seen = 0;

extern "C" void note_interrupt(int signal) {
  interrupt_seen = 1;
  std::signal(signal, SIG_DFL);
}

std::string duration(double seconds) {
  char text[32];
  if (seconds < 60) {
    std::snprintf(text, sizeof text, "%.0f s", seconds);
  } else if (seconds < 3600) {
    std::snprintf(text, sizeof text, "%d:%02d min", static_cast<int>(seconds) / 60,
                  static_cast<int>(seconds) % 60);
  } else {
    std::snprintf(text, sizeof text, "%.1f h", seconds / 3600);
  }
  return text;
}

}  // namespace

void catch_interrupts() {
  std::signal(SIGINT, note_interrupt);
  std::signal(SIGTERM, note_interrupt);
}

bool interrupted() { return interrupt_seen != 0; }

Progress::Progress(std::string label, double total, bool quiet)
    : label_(std::move(label)), total_(total), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);  // the summary takes the bar's place
}

double Progress::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

bool Progress::cancelled() const { return interrupted() || seconds() > limit_; }

void Progress::advance(double units) {
  done_ = std::min(done_ + units, total_);
  if (quiet_ || seconds() - shown_at_ < (terminal_ ? 0.1 : 3.0)) return;
  const double fraction = total_ > 0 ? done_ / total_ : 1;
  const double elapsed = seconds();
  const double left =
      std::min(fraction > 0 ? elapsed / fraction - elapsed : 0, std::max(limit_ - elapsed, 0.0));
  if (terminal_) {
    constexpr int width = 32;
    std::string bar(width, '.');
    std::fill_n(bar.begin(), static_cast<int>(fraction * width), '#');
    std::fprintf(stderr, "\r%s [%s] %3.0f %%, %s left\033[K", label_.c_str(), bar.c_str(), 100 * fraction,
                 duration(left).c_str());
  } else {
    std::fprintf(stderr, "%s: %.0f %%, %s left\n", label_.c_str(), 100 * fraction, duration(left).c_str());
  }
  std::fflush(stderr);
  shown_ = true;
  shown_at_ = elapsed;
}

}  // namespace trilha
