#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "common/scene/made.h"
#include "common/scene/scene.h"

namespace trilha {

/// A scene that load_scene knows by name.
struct SceneEntry {
  /// Made by the program, a file in assets/scenes, or one that ./trilha assets fetches.
  enum class Kind { made, shipped, fetched };

  std::string name;
  Kind kind = Kind::made;
  std::string what;                   ///< for people, in a few words
  std::string licence;                ///< of its data
  std::string asset;                  ///< what has to be fetched for it; empty: nothing
  std::string collection;             ///< that it is one of; empty: none. Its name then is COLLECTION/…
  std::filesystem::path file;         ///< empty where it is made
  bool available = true;              ///< false where it has to be fetched first
  std::vector<Parameter> parameters;  ///< of a made scene
  /// As assets/library/scenes states them, of a made scene for the parameters as they are unless said; empty
  /// where it states none. Nothing is loaded to find out; a test compares them with the scenes.
  std::optional<std::size_t> triangles;
  std::vector<std::string> features;
};

/// Many scenes that are fetched together, too many for a list.
struct SceneCollection {
  std::string name, what, licence;
  std::size_t scenes = 0, available = 0;
};

/// All of them, those of collections too: made ones, then files, then fetched ones. Throws InputError where
/// the project's files are not found.
std::vector<SceneEntry> scene_table();
std::vector<SceneCollection> scene_collections();

/// Prints what there is in lines of at most 110 characters: the scenes, then the collections, then the
/// parameters of made scenes; or the scenes of the collection named, or all about the scene named. Throws
/// InputError for another name.
void print_scenes(std::ostream& out, const std::string& name = "");

/// The same as JSON: {"scenes": […], "collections": […]}, those of collections among them.
std::string scenes_as_json(const std::string& name = "");

/// The folder that holds assets/: the environment's TRILHA_ROOT, else the nearest above the running program,
/// else where the program was built. Throws InputError where there is none.
std::filesystem::path root_folder();

}  // namespace trilha
