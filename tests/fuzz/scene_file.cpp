// Scene files in a folder with a model, a scene file and an image beside them, which they may include.

#include "common/scene/scene_file.h"
#include "tests/fuzz/fuzz.h"

namespace {

/// The folder, with what does not change in it.
std::string furnished() {
  const auto place = [](const char* name, const std::string& text) {
    return trilha::fuzz::file_of(name, reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  };
  place("tri.obj", "o tri\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  place("back.json", R"({"include": [{"file": "scene.json"}]})");
  const std::string path = place("inner.json", R"({
    "materials": [{"name": "m"}],
    "meshes": [{"name": "t", "positions": [0,0,0, 1,0,0, 0,1,0], "triangles": [0,1,2], "material": "m"},
               {"name": "f", "file": "tri.obj"}],
    "instances": [{"mesh": "t"}, {"mesh": "t", "transform": [{"scale": [-1, 2, 1]}]}],
    "spheres": [{"centre": [0,0,0], "radius": 1}], "planes": [{"normal": [0,1,0]}],
    "lights": [{"name": "l", "kind": "point", "position": [0,1,0]}],
    "camera": {"eye": [0,0,5], "target": [0,0,0]}, "views": [{"name": "v", "eye": [5,0,0], "target": [0,0,0]}]})");
  return path.substr(0, path.rfind('/'));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string folder = furnished();
  const std::string path = trilha::fuzz::file_of("scene.json", data, size);
  // what is refused may be a file that the scene includes: it is in the folder
  return trilha::fuzz::reads_or_refuses(folder, [&](const std::string&) { trilha::load_scene_file(path); });
}
