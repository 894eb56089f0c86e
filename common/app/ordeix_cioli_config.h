#pragma once
// The configuration file of the ray tracer of Ordeix & Cioli (2010, figure 4.2), said in flags.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace trilha {

/// A statement of such a file, and what it means here.
struct OrdeixCioliStatement {
  /// A flag's name without its dashes, and its value.
  struct Flag {
    std::string name, value;
  };
  std::string key;          ///< "ZERO"; of parts that go together, what they share: "RESOLUCION"
  std::size_t line;         ///< of the last part
  std::vector<Flag> flags;  ///< all of which a chapter needs for the statement to have a use
  std::string chapter;      ///< the first one whose settings these flags are; empty: every chapter has them
};

/// Is the text such a file? Its first statement says so, by its key.
bool is_ordeix_cioli_config(std::string_view text);

/// The file's statements: "KEY=value" a line, at most once each, with /* comments */ anywhere. RESOLUCION.X
/// and .Y are one --size; ESCENA is relative to the file's folder, unless it is a name without dot and slash,
/// of the library's. `text` is what the file holds. Throws InputError with file and line for an unknown or
/// repeated key, a value that is no number where one is wanted, half a RESOLUCION, a comment without an end.
/// Ranges are looked at by the flags.
std::vector<OrdeixCioliStatement> read_ordeix_cioli_config(const std::string& path, std::string_view text);

}  // namespace trilha
