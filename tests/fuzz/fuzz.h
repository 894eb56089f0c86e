#pragma once
// What the fuzz targets share: bytes as a file, and the one way in which input may be refused.

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/error.h"

namespace trilha::fuzz {

/// The file of that name, which holds those bytes, in a folder in memory that this process alone has.
inline std::string file_of(const char* name, const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path folder = [] {
    const auto path = std::filesystem::path("/dev/shm") / ("trilha_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    std::atexit([] { std::filesystem::remove_all("/dev/shm/trilha_fuzz_" + std::to_string(getpid())); });
    return path;
  }();
  const std::string path = (folder / name).string();
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(data), std::streamsize(size));
  return path;
}

/// Reads it; a refusal has to be one line that names the file. Whatever else is thrown ends the program.
template <class Read>
int reads_or_refuses(const std::string& path, const Read& read) {
  try {
    read(path);
  } catch (const InputError& error) {
    const std::string what = error.what();
    if (what.find('\n') != what.npos || what.rfind(path, 0) != 0) {
      std::fprintf(stderr, "not a refusal in one line that names the file: %s\n", what.c_str());
      std::abort();
    }
  }
  return 0;
}

}  // namespace trilha::fuzz
