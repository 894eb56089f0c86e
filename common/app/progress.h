#pragma once

#include <chrono>
#include <string>

namespace trilha {

/// Tells how far long work is, on standard error: a bar with the time left on a terminal, a line every few
/// seconds elsewhere. Work asks it whether to stop.
class Progress {
 public:
  /// `quiet` shows nothing. The work consists of `total` units of any kind.
  Progress(std::string label, double total, bool quiet);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(double units);

  /// Has Ctrl-C been pressed, or the time limit passed? What has been done so far is kept.
  bool cancelled() const;
  void stop_after(double seconds) { limit_ = seconds; }
  double seconds() const;

 private:
  std::string label_;
  double total_;
  double done_ = 0;
  double limit_ = 1e300;
  bool quiet_;
  bool terminal_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double shown_at_ = 0;
  bool shown_ = false;
};

/// From now on the first Ctrl-C (or SIGTERM) only makes interrupted() true; the second one ends the program.
void catch_interrupts();
bool interrupted();

}  // namespace trilha
