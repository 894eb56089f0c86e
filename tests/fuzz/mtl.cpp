// Material libraries, read through an OBJ file that uses what they define.

#include "common/scene/obj.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string obj = [] {
    const std::string text =
        "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nlp 1\n"
        "f 1 2 3\n";
    return trilha::fuzz::file_of("scene.obj", reinterpret_cast<const std::uint8_t*>(text.data()),
                                 text.size());
  }();
  return trilha::fuzz::reads_or_refuses(trilha::fuzz::file_of("scene.mtl", data, size),
                                        [](const std::string&) { trilha::load_obj(obj); });
}
