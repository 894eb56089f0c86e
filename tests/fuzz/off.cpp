// OFF files.

#include "common/scene/off.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // What is packed may be a thousand times as long: such files would take most of the time.
  if (size > 800 && data[0] == 0x1f && data[1] == 0x8b) return -1;
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.off", data, size),
                                        [](const std::string& path) { trilha::load_off(path); });
}
