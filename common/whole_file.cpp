#include "common/whole_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "common/error.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

/// A file that takes its name only when it is complete.
class WholeFile {
 public:
  explicit WholeFile(std::string path) : path_(std::move(path)), temporary_(path_) {
    std::error_code ignored;
    if (fs::is_directory(path_, ignored)) refuse("it is a directory");
    if (!fs::exists(path_, ignored) || fs::is_regular_file(path_, ignored))
      temporary_ = path_ + ".part" + std::to_string(getpid());
    file_ = std::fopen(temporary_.c_str(), "wb");
    if (!file_) refuse(std::strerror(errno));
  }
  ~WholeFile() { discard(); }

  void write(const std::string& bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail();
  }

  void commit() {
    if (std::fflush(file_) != 0 || (temporary_ != path_ && fsync(fileno(file_)) != 0)) fail();
    if (std::fclose(std::exchange(file_, nullptr)) != 0) fail();
    if (temporary_ != path_ && std::rename(temporary_.c_str(), path_.c_str()) != 0) fail();
    temporary_ = path_;
  }

 private:
  void discard() {
    if (file_) std::fclose(std::exchange(file_, nullptr));
    if (temporary_ != path_) std::remove(temporary_.c_str());
  }
  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(path_ + ": cannot be written: " + what + "; name a file in a folder with room for it");
  }
  [[noreturn]] void fail() {
    const std::string reason = std::strerror(errno);
    discard();
    refuse(reason);
  }

  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
};

}  // namespace

void write_whole_file(const std::string& path, const std::string& bytes) {
  WholeFile file(path);
  file.write(bytes);
  file.commit();
}

void check_can_write_file(const std::string& path) { WholeFile attempt(path); }

std::string free_name(const std::string& stem, const std::string& extension) {
  std::error_code error;
  for (int number = 1;; ++number) {
    std::string name = stem + "_" + std::to_string(number) + extension;
    if (!fs::exists(fs::symlink_status(name, error))) return name;
  }
}

void make_folder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || access(folder.c_str(), W_OK) != 0)
    throw InputError(
        folder + ": cannot be written to: " + (error ? error.message() : std::string(std::strerror(errno))) +
        "; name a folder that can be made or written to");
}

}  // namespace trilha
