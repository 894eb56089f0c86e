#pragma once
// Programs seen from outside: a folder to run them in, and what they print and return.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace trilha::testing {

namespace fs = std::filesystem;

/// A new folder that is gone afterwards, with a space in its name.
struct Folder {
  fs::path path = fs::temp_directory_path() / ("trilha test " + std::to_string(getpid()));
  Folder() {
    fs::remove_all(path);
    fs::create_directories(path);
  }
  ~Folder() { fs::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(const std::string& name) const { return (path / name).string(); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(path), {}));
  }
};

inline std::string contents(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline void write(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

struct Result {
  int code;
  std::string out, err;
  double seconds;
  std::size_t bytes;  ///< of memory, at most
};

/// Runs a program in the folder; {} in the arguments stands for the folder. A signal may be sent after a
/// while. The program finds no display: it can open no window on the desktop of whoever runs the tests.
inline Result run(const std::string& program, const Folder& folder, std::string arguments,
                  double interrupt_after = -1) {
  for (std::size_t at; (at = arguments.find("{}")) != std::string::npos;)
    arguments.replace(at, 2, "'" + folder.path.string() + "'");
  const fs::path out = fs::temp_directory_path() / ("trilha_out" + std::to_string(getpid()));
  const fs::path err = fs::temp_directory_path() / ("trilha_err" + std::to_string(getpid()));
  const std::string command = "unset DISPLAY WAYLAND_DISPLAY; cd '" + folder.path.string() + "' && exec '" +
                              program + "' " + arguments + " >" + out.string() + " 2>" + err.string();
  const auto start = std::chrono::steady_clock::now();
  const pid_t child = fork();
  if (child == 0) {
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  if (interrupt_after >= 0) {
    usleep(static_cast<useconds_t>(interrupt_after * 1e6));
    kill(child, SIGINT);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  Result result{WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), contents(out), contents(err),
                taken.count(), static_cast<std::size_t>(usage.ru_maxrss) * 1024};
  fs::remove(out);
  fs::remove(err);
  return result;
}

}  // namespace trilha::testing
