#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace trilha {

/// A scene that load_scene knows by name.
struct SceneEntry {
  std::string name;
  std::string what;  ///< for people, in a few words
  bool available;    ///< false where it has to be fetched first
};

/// All of them, for listings. Throws InputError where the project's files are not found.
std::vector<SceneEntry> scene_table();

/// The folder that holds assets/: the environment's TRILHA_ROOT, else the nearest above the running program,
/// else where the program was built. Throws InputError where there is none.
std::filesystem::path root_folder();

}  // namespace trilha
