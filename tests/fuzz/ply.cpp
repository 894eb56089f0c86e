// PLY files, in every format and packed.

#include "common/scene/ply.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/packed.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (trilha::fuzz::unpacks_to_much(data, size)) return -1;
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.ply", data, size),
                                        [](const std::string& path) { trilha::load_ply(path); });
}
