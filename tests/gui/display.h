#pragma once
// A display of our own for tests of windows: Xvfb, which draws into memory.

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>

#include "tests/testing.h"

namespace trilha::testing {

/// Starts an X server that no other process uses and makes it this process's display (DISPLAY), until it is
/// destroyed. Skips the test case where Xvfb is not installed. The server ends with this process, however
/// that ends.
class VirtualDisplay {
 public:
  /// A screen of so many pixels, of 24 bits.
  explicit VirtualDisplay(int width = 3840, int height = 2160) {
    const std::string program = find_program();
    if (program.empty()) skip("Xvfb is not installed (Debian's package xvfb)");
    const std::string screen = std::to_string(width) + "x" + std::to_string(height) + "x24";
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("no pipe to Xvfb");
    const std::string end = std::to_string(ends[1]);
    const pid_t parent = getpid();
    server_ = fork();
    if (server_ == 0) {  // from here on only what a process with threads may do between fork and exec
      prctl(PR_SET_PDEATHSIG, SIGTERM);  // when the thread that forked ends
      if (getppid() != parent) _exit(127);
      const int nowhere = open("/dev/null", O_RDWR);
      for (const int standard : {0, 1, 2}) dup2(nowhere, standard);
      execl(program.c_str(), "Xvfb", "-displayfd", end.c_str(), "-screen", "0", screen.c_str(), "-nolisten",
            "tcp", "-noreset", nullptr);
      _exit(127);
    }
    if (server_ < 0) throw std::runtime_error("no process for Xvfb");
    close(ends[1]);
    const std::string number = read_line(ends[0]);
    close(ends[0]);
    if (number.empty()) {
      stop();
      throw std::runtime_error("Xvfb did not start a screen of " + screen);
    }
    if (const char* const display = std::getenv("DISPLAY")) before_ = display;
    name_ = ":" + number;
    setenv("DISPLAY", name_.c_str(), 1);
  }
  ~VirtualDisplay() {
    stop();
    if (before_)
      setenv("DISPLAY", before_->c_str(), 1);
    else
      unsetenv("DISPLAY");
  }
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

  /// ":99"
  const std::string& name() const { return name_; }

 private:
  static std::string find_program() {
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path ? path : "");
    for (std::string folder; std::getline(folders, folder, ':');)
      if (const std::string program = folder + "/Xvfb"; access(program.c_str(), X_OK) == 0) return program;
    return "";
  }

  /// The first line that comes within half a minute, which is a hundred times what Xvfb takes.
  static std::string read_line(int from) {
    std::string line;
    for (pollfd ready{from, POLLIN, 0}; poll(&ready, 1, 30'000) > 0;) {
      char c;
      if (read(from, &c, 1) != 1) return "";
      if (c == '\n') return line;
      line += c;
    }
    return "";
  }

  void stop() {
    kill(server_, SIGTERM);
    waitpid(server_, nullptr, 0);
  }

  pid_t server_ = -1;
  std::string name_;
  std::optional<std::string> before_;
};

}  // namespace trilha::testing
