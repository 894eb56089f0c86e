#pragma once
// JSON that knows its lines: what the scene file's and glTF's readers share.

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "common/math/vector.h"

namespace trilha {

/// A JSON value and the line that it begins on.
struct Json {
  enum class Kind : std::uint8_t { null, boolean, number, text, list, object };
  struct Contents;

  Kind kind = Kind::null;
  std::uint32_t line = 0;
  double number = 0;                   ///< of a boolean 0 or 1
  std::unique_ptr<Contents> contents;  ///< of text, list and object; none where those are empty

  const std::string& text() const;
  const std::vector<Json>& list() const;
  /// In the order of the file; no key twice.
  const std::vector<std::pair<std::string, Json>>& members() const;
  /// The member of an object; nullptr where there is none.
  const Json* find(std::string_view key) const;
};

struct Json::Contents {
  std::variant<std::string, std::vector<Json>, std::vector<std::pair<std::string, Json>>> of;
};

/// The most text that parse_json takes, and the most values in it.
constexpr std::size_t most_json_bytes = std::size_t{64} << 20;
constexpr std::size_t most_json_values = std::size_t{1} << 23;

/// The value that the text is. Throws InputError, with `path` and the line, for what is no JSON (RFC 8259,
/// UTF-8; a byte order mark is passed over), is nested more than 64 deep, has a key twice in an object, a
/// number that no double holds, or is larger than the limits above. Takes at most 48 bytes of memory for a
/// byte of text, and 1 GB altogether. Lines end with LF, CR LF or CR.
Json parse_json(const std::string& path, std::string_view text);

/// "a number", "text", "a list", …
const char* kind_name(Json::Kind kind);

/// Reads the members of an object, strictly: what is no object, has a key that is not known, or a value of
/// another kind or beyond its range is refused with key and line.
class Members {
 public:
  /// `what` names the object for people ("a material"). An empty list of known keys takes all keys.
  Members(const std::string& path, const Json& object, const char* what,
          std::initializer_list<std::string_view> known)
      : Members(path, object, what, std::span(known.begin(), known.size())) {}
  Members(const std::string& path, const Json& object, const char* what,
          std::span<const std::string_view> known);

  bool has(std::string_view key) const { return object_.find(key) != nullptr; }
  const Json* find(std::string_view key) const { return object_.find(key); }
  /// The line that the object begins on.
  std::size_t line() const { return object_.line; }
  /// Refuses where the key is missing.
  const Json& need(std::string_view key) const;

  double number(std::string_view key, double otherwise, double low, double high) const;
  bool flag(std::string_view key, bool otherwise) const;
  /// A whole number.
  std::int64_t whole(std::string_view key, std::int64_t otherwise, std::int64_t low, std::int64_t high) const;
  std::string text(std::string_view key, const std::string& otherwise) const;
  /// Three numbers.
  dvec3 vector(std::string_view key, const dvec3& otherwise, double low, double high) const;
  /// The list of that key; empty where there is none.
  const std::vector<Json>& list(std::string_view key) const;

  [[noreturn]] void refuse_key(std::string_view key, const std::string& what) const;

 private:
  const std::string& path_;
  const Json& object_;
  const char* what_;
};

/// The numbers of a list of that many; `low` and `high` bound them. Throws InputError.
std::vector<double> numbers(const std::string& path, const Json& list, std::string_view key,
                            std::size_t count, double low, double high);

}  // namespace trilha
