#pragma once
// What the tests of PLY and OFF files share: files in a folder, gzip, damage, and a closed surface.

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "common/scene/scene.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"

namespace trilha::testing {

/// The bytes as one member of a gzip file (RFC 1952).
inline std::string packed(const std::string& bytes, int level = 6) {
  z_stream stream{};
  deflateInit2(&stream, level, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY);
  std::string result(deflateBound(&stream, static_cast<uLong>(bytes.size())) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(result.size());
  deflate(&stream, Z_FINISH);
  result.resize(stream.total_out);
  deflateEnd(&stream);
  return result;
}

/// write(), for many files of one name: ext4 waits for the disk where a file is written over.
inline void write_anew(const std::string& path, const std::string& bytes) {
  fs::remove(path);
  write(path, bytes);
}

/// The same bits: −0 is not 0.
template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// How many ways to damage the bytes lead to a refusal, and how many to a sound scene: every bit flipped,
/// every byte made 0 and 255, the file cut off everywhere. `load` takes a path. Anything else fails the test.
struct Damage {
  int refused = 0, read = 0;
};
template <class Load>
Damage damaged(const std::string& bytes, const std::string& path, const Load& load) {
  Damage damage;
  const auto attempt = [&](const std::string& wrong) {
    write_anew(path, wrong);
    Scene scene;
    const auto message = refusal([&] { scene = load(path); });
    if (message) {
      ++damage.refused;
      if (message->rfind(path, 0) != 0 || message->find('\n') != std::string::npos) FAIL(*message);
    } else {
      ++damage.read;
      for (const Mesh& mesh : scene.meshes)
        if (!sound(mesh)) FAIL("a mesh that is not sound");
    }
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string wrong = bytes;
    for (int bit = 0; bit < 8; ++bit) {
      wrong[i] = static_cast<char>(bytes[i] ^ (1 << bit));
      attempt(wrong);
    }
    for (const char byte : {'\0', '\xff'}) {
      wrong[i] = byte;
      if (byte != bytes[i]) attempt(wrong);
    }
    attempt(bytes.substr(0, i));
  }
  return damage;
}

/// A closed surface whose front is outside: a sphere of n × 2n quadrilaterals and caps of triangles, as
/// corners of faces.
struct Polygons {
  std::vector<vec3> positions;
  std::vector<std::vector<std::uint32_t>> faces;
};
inline Polygons globe(std::uint32_t n) {
  Polygons globe;
  const double pi_ = 3.14159265358979323846;
  globe.positions.push_back({0, 1, 0});
  for (std::uint32_t i = 1; i < n; ++i)
    for (std::uint32_t j = 0; j < 2 * n; ++j)
      globe.positions.push_back(vec3(std::sin(pi_ * i / n) * std::sin(pi_ * j / n), std::cos(pi_ * i / n),
                                     std::sin(pi_ * i / n) * std::cos(pi_ * j / n)));
  globe.positions.push_back({0, -1, 0});
  const auto at = [n](std::uint32_t i, std::uint32_t j) {
    return i == 0 ? 0 : i == n ? 2 * n * (n - 1) + 1 : 1 + (i - 1) * 2 * n + j % (2 * n);
  };
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < 2 * n; ++j) {
      if (i == 0) globe.faces.push_back({0, at(1, j), at(1, j + 1)});
      if (i == n - 1) globe.faces.push_back({at(i, j), at(n, 0), at(i, j + 1)});
      if (i > 0 && i < n - 1) globe.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return globe;
}

inline double volume(const Mesh& mesh) {
  double sum = 0;
  for (const uvec3& t : mesh.triangles)
    sum += glm::dot(dvec3(mesh.positions[t.x]),
                    glm::cross(dvec3(mesh.positions[t.y]), dvec3(mesh.positions[t.z])));
  return sum / 6;
}

/// The most memory this process had since the last call, in bytes; 0 where that is not known, as under
/// sanitizers.
inline std::size_t peak_memory_since_last_call() {
#if defined(__SANITIZE_ADDRESS__)
  return 0;
#else
  std::ifstream status("/proc/self/status");
  std::size_t peak = 0;
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmHWM:", 0) == 0) peak = 1024 * std::stoull(line.substr(6));
  std::ofstream reset("/proc/self/clear_refs");
  reset << "5" << std::flush;
  return reset ? peak : 0;
#endif
}

}  // namespace trilha::testing
