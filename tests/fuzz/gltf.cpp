// glTF, .gltf or .glb as its first bytes say, with its buffers and images inside.

#include "common/scene/gltf.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.gltf", data, size),
                                        [](const std::string& path) { trilha::load_gltf(path); });
}
