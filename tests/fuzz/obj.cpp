// OBJ files, alone.

#include "common/scene/obj.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.obj", data, size),
                                        [](const std::string& path) { trilha::load_obj(path); });
}
