#pragma once
// What every reader of scene files is told, and where it may read.

#include <cstddef>
#include <filesystem>
#include <string>

namespace trilha {

/// What loading a scene may read, and what it need not.
struct LoadOptions {
  bool allow_paths = false;           ///< scene files may name files outside their folder
  bool textures = true;               ///< decode the images that materials name
  bool environment = true;            ///< decode the image around the scene
  std::filesystem::path folder = {};  ///< nothing outside is read; empty: the folder of the first file
};

/// The options for what the scene file names: with its folder, where none is set yet.
LoadOptions within_folder_of(const std::string& path, LoadOptions options);

/// The file that `name` means in line `line` of the scene file `path`: relative to that file's folder;
/// backslashes separate folders too. It need not exist. Throws InputError where it lies outside
/// LoadOptions::folder, by "..", as an absolute path or through a symbolic link, and allow_paths does not
/// allow that; or where the name is empty or has a byte that no name has.
std::filesystem::path named_file(const std::string& name, const std::string& path, std::size_t line,
                                 const LoadOptions& options);

}  // namespace trilha
