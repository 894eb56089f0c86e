// PLY files, in every format and packed.

#include "common/scene/ply.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.ply", data, size),
                                        [](const std::string& path) { trilha::load_ply(path); });
}
