#include "common/scene/load.h"

#include <algorithm>
#include <system_error>

#include "common/scene/text.h"

namespace trilha {

namespace fs = std::filesystem;

LoadOptions within_folder_of(const std::string& path, LoadOptions options) {
  if (options.folder.empty()) {
    std::error_code error;
    const fs::path absolute = fs::absolute(path, error);
    // the folder that the file is named in: what the name itself links to lies where it lies
    options.folder = fs::weakly_canonical(absolute.parent_path(), error);
    if (error) options.folder = absolute.parent_path();
  }
  return options;
}

fs::path named_file(const std::string& name, const std::string& path, std::size_t line,
                    const LoadOptions& options) {
  std::string slashed = name;
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  if (slashed.empty()) refuse(path, line, "a file name that is empty; name a file");
  if (slashed.size() > 1024)
    refuse(path, line, "a file name of " + std::to_string(slashed.size()) + " bytes; 1024 are the most");
  if (std::any_of(slashed.begin(), slashed.end(), [](unsigned char c) { return c < 32; }))
    refuse(path, line, "a file name with a control character, " + in_quotes(name) + "; rename the file");
  const fs::path file = fs::path(path).parent_path() / slashed;  // an absolute name stands alone
  if (options.allow_paths) return file;
  const fs::path folder = within_folder_of(path, options).folder;
  std::error_code error;
  const fs::path real = fs::weakly_canonical(fs::absolute(file, error), error);
  const auto [end_of_folder, rest] = std::mismatch(folder.begin(), folder.end(), real.begin(), real.end());
  if (error || end_of_folder != folder.end() || rest == real.end())
    refuse(path, line, in_quotes(name) + " lies outside the scene's folder; --allow-paths reads it");
  return file;
}

}  // namespace trilha
