#include "common/app/ordeix_cioli_config.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "common/scene/text.h"

namespace trilha {
namespace {

struct Key {
  enum class Kind { whole, number, scene };
  const char* name;
  Kind kind;
  const char* flag;     ///< that takes its value; empty: half a --size
  const char* chapter;  ///< as OrdeixCioliStatement has it
};

constexpr Key keys[] = {
    {"TAMANIO_GRILLA.X", Key::Kind::whole, "grid-x", "03_uniform_grid"},
    {"TAMANIO_GRILLA.Y", Key::Kind::whole, "grid-y", "03_uniform_grid"},
    {"TAMANIO_GRILLA.Z", Key::Kind::whole, "grid-z", "03_uniform_grid"},
    {"RESOLUCION.X", Key::Kind::whole, "", ""},
    {"RESOLUCION.Y", Key::Kind::whole, "", ""},
    {"INFINITO", Key::Kind::number, "farthest", "02_whitted"},
    {"ZERO", Key::Kind::number, "fixed-offset", "02_whitted"},
    {"PROFUNDIDAD_RECURSION", Key::Kind::whole, "depth", "02_whitted"},
    {"THREADS.X", Key::Kind::whole, "block-width", "02_whitted"},
    {"THREADS.Y", Key::Kind::whole, "block-height", "02_whitted"},
    {"ESCENA", Key::Kind::scene, "scene", ""},
};

const Key* find_key(std::string_view name) {
  const auto* found =
      std::find_if(std::begin(keys), std::end(keys), [&](const Key& k) { return k.name == name; });
  return found == std::end(keys) ? nullptr : found;
}

std::string_view trimmed(std::string_view text) {
  constexpr const char* spaces = " \t\r\v\f\n";
  const std::size_t begin = text.find_first_not_of(spaces);
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(spaces) + 1 - begin);
}

/// The text with blanks for its comments and its byte order mark, so that lines stay where they are. `open`
/// is where a comment begins that does not end, or npos.
std::string without_comments(std::string_view text, std::size_t& open) {
  std::string result(text);
  const auto blank = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (result[i] != '\n') result[i] = ' ';
  };
  if (text.starts_with("\xef\xbb\xbf")) blank(0, 3);
  open = text.npos;
  for (std::size_t begin = 0; (begin = text.find("/*", begin)) != text.npos;) {
    const std::size_t end = text.find("*/", begin + 2);
    if (end == text.npos) open = begin;
    blank(begin, std::min(end, text.size() - 2) + 2);
    if (end == text.npos) break;
    begin = end + 2;
  }
  return result;
}

template <class T>
bool is(const std::string& text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() &&
         std::isfinite(static_cast<double>(value));
}

/// A name of the library's as it is, a file as seen from where the configuration file is seen from.
std::string scene_of(const std::string& value, const std::string& config) {
  namespace fs = std::filesystem;
  if (value.find_first_of("./") == value.npos) return value;
  return (fs::path(config).parent_path() / value).lexically_normal().string();
}

}  // namespace

bool is_ordeix_cioli_config(std::string_view text) {
  std::size_t open = 0;
  const std::string plain = without_comments(text, open);
  const std::string_view statements = trimmed(plain);
  return find_key(trimmed(statements.substr(0, statements.find_first_of("=\n")))) != nullptr;
}

std::vector<OrdeixCioliStatement> read_ordeix_cioli_config(const std::string& path, std::string_view text) {
  std::size_t open = 0;
  const std::string plain = without_comments(text, open);
  if (open != text.npos)
    refuse(path,
           1 + static_cast<std::size_t>(
                   std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(open), '\n')),
           "a comment is not closed; write */ at its end");
  std::vector<OrdeixCioliStatement> statements;
  std::map<std::string, std::size_t> lines;  // of the keys
  std::optional<std::string> sides[2];       // of the image
  std::size_t line = 0;
  for (std::size_t begin = 0; begin < plain.size();) {
    const std::size_t end = std::min(plain.find('\n', begin), plain.size());
    const std::string_view statement = trimmed(std::string_view(plain).substr(begin, end - begin));
    begin = end + 1;
    ++line;
    if (statement.empty()) continue;
    const std::size_t equals = statement.find('=');
    const std::string_view name = trimmed(statement.substr(0, equals));
    const Key* key = find_key(name);
    if (key == nullptr) {
      std::string names;
      for (const Key& one : keys) names += (names.empty() ? "" : ", ") + std::string(one.name);
      refuse(path, line, in_quotes(name) + " is no key of such a file; there are " + names);
    }
    const std::string value(equals == statement.npos ? "" : trimmed(statement.substr(equals + 1)));
    const std::string refused = std::string(key->name) + ": " + in_quotes(value) + " ";
    if (value.empty()) refuse(path, line, std::string(key->name) + " has no value; write KEY=value");
    if (const auto [said, first] = lines.emplace(key->name, line); !first)
      refuse(path, line,
             std::string(key->name) + " is said in line " + std::to_string(said->second) +
                 " already; say it once");
    if (key->kind == Key::Kind::whole && !is<long long>(value))
      refuse(path, line, refused + "is no whole number; write digits alone");
    if (key->kind == Key::Kind::number && !is<double>(value))
      refuse(path, line, refused + "is no number; write one, such as 0.000001");
    if (*key->flag == '\0') {
      sides[key->name[sizeof "RESOLUCION." - 1] - 'X'] = value;
      if (sides[0] && sides[1])
        statements.push_back({"RESOLUCION", line, {{"size", *sides[0] + "x" + *sides[1]}}, ""});
      continue;
    }
    statements.push_back({key->name, line, {}, key->chapter});
    auto& flags = statements.back().flags;
    if (statements.back().key == "ZERO") flags.push_back({"self-intersection", "fixed"});
    flags.push_back({key->flag, key->kind == Key::Kind::scene ? scene_of(value, path) : value});
  }
  for (const char* half : {"RESOLUCION.X", "RESOLUCION.Y"})
    if (lines.count(half) != 0 && !(sides[0] && sides[1]))
      refuse(path, lines[half], std::string(half) + " says half of a size; give both .X and .Y");
  return statements;
}

}  // namespace trilha
