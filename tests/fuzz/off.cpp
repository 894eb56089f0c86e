// OFF files.

#include "common/scene/off.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.off", data, size),
                                        [](const std::string& path) { trilha::load_off(path); });
}
