#pragma once

#include <string>

namespace trilha {

/// Writes a file that appears whole or not at all: it is written beside its place and then renamed. A path
/// that is no plain file, such as /dev/stdout, is written to directly. Throws InputError, with the system's
/// reason.
void write_whole_file(const std::string& path, const std::string& bytes);

/// Throws what write_whole_file would, as far as can be known: said before an hour of work rather than after.
void check_can_write_file(const std::string& path);

/// A path that nothing has yet: "STEM_1.png", "STEM_2.png", … for the extension ".png".
std::string free_name(const std::string& stem, const std::string& extension);

/// Makes the folder, and those above it, unless it is there. Throws InputError where it cannot be made or
/// written to.
void make_folder(const std::string& folder);

}  // namespace trilha
