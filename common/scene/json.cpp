#include "common/scene/json.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numeric>

#include "common/scene/text.h"

namespace trilha {
namespace {

constexpr std::size_t deepest = 64;

/// Hands characters to the parser, and says on which line it stands.
class Cursor {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  struct Place {
    const char* last = nullptr;  // character read
    std::uint32_t line = 1;      // of `last`, which may already be beyond the token
    bool beyond = false;         // what follows `last` is on the next line
  };

  Cursor(const char* at, Place* place) : at_(at), place_(place) {}
  reference operator*() const {
    if (place_ != nullptr && place_->last != at_) {
      if (place_->beyond) ++place_->line;
      const bool ended = *at_ == '\n' && place_->last != nullptr && *place_->last == '\r';
      if (ended) --place_->line;  // CR LF is one end of a line: LF still belongs to the line of CR
      place_->beyond = *at_ == '\n' || *at_ == '\r';
      place_->last = at_;
    }
    return *at_;
  }
  Cursor& operator++() {
    ++at_;
    return *this;
  }
  bool operator==(const Cursor& other) const { return at_ == other.at_; }
  bool operator!=(const Cursor& other) const { return at_ != other.at_; }

 private:
  const char* at_;
  Place* place_;
};

/// Builds the value from the parser's calls, without recursion.
class Builder {
 public:
  using number_integer_t = nlohmann::json::number_integer_t;
  using number_unsigned_t = nlohmann::json::number_unsigned_t;
  using number_float_t = nlohmann::json::number_float_t;
  using string_t = nlohmann::json::string_t;
  using binary_t = nlohmann::json::binary_t;

  Builder(const std::string& path, const Cursor::Place& place) : path_(path), place_(place) {}

  Json root;

  bool null() { return scalar(Json::Kind::null, 0); }
  bool boolean(bool value) { return scalar(Json::Kind::boolean, value ? 1 : 0); }
  bool number_integer(number_integer_t value) { return scalar(Json::Kind::number, double(value)); }
  bool number_unsigned(number_unsigned_t value) { return scalar(Json::Kind::number, double(value)); }
  bool number_float(number_float_t value, const string_t&) { return scalar(Json::Kind::number, value); }
  bool string(string_t& value) {
    Json& json = add(Json::Kind::text, 0);
    if (!value.empty()) json.contents = std::make_unique<Json::Contents>(Json::Contents{std::move(value)});
    return true;
  }
  bool binary(binary_t&) { return false; }
  bool start_object(std::size_t) { return open(Json::Kind::object); }
  bool start_array(std::size_t) { return open(Json::Kind::list); }
  bool end_array() {
    open_.pop_back();
    return true;
  }
  bool end_object() {
    // A list of keys is looked through at its end, when it is known how many there are.
    const auto& members = open_.back()->members();
    using Member = const std::pair<std::string, Json>*;
    std::vector<Member> sorted(members.size());
    std::iota(sorted.begin(), sorted.end(), members.data());
    std::sort(sorted.begin(), sorted.end(), [](Member a, Member b) {
      const int order = a->first.compare(b->first);
      return order != 0 ? order < 0 : a < b;
    });
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end(),
                                          [](Member a, Member b) { return a->first == b->first; });
    if (twice != sorted.end())
      refuse(path_, twice[1]->second.line,
             "the key " + in_quotes(twice[1]->first) + " stands twice in one object; keep one");
    open_.pop_back();
    return true;
  }
  bool key(string_t& value) {
    key_ = std::move(value);
    return true;
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception& error) {
    std::string what = error.what();
    if (const auto dash = what.find(" - "); dash != what.npos) what = what.substr(dash + 3);
    if (const auto bracket = what.find("] "); what[0] == '[' && bracket != what.npos)
      what = what.substr(bracket + 2);
    if (const auto last = what.find("; last read"); last != what.npos) what = what.substr(0, last);
    for (char& c : what)
      if (static_cast<unsigned char>(c) < 32) c = '?';
    if (what.size() > 100) what = what.substr(0, 100) + "…";
    std::replace(what.begin(), what.end(), ';', ',');
    refuse(path_, line(), "is no JSON: " + what + "; a JSON text (RFC 8259) is wanted");
  }

 private:
  // Numbers end with a character that is beyond them; all else ends with its own last one.
  std::uint32_t line() const { return place_.line; }

  bool scalar(Json::Kind kind, double number) {
    add(kind, number);
    return true;
  }

  Json& add(Json::Kind kind, double number) {
    if (++values_ > most_json_values)
      refuse(path_, line(),
             "more than " + std::to_string(most_json_values) +
                 " values; keep what is large in a model's file (.ply, .obj, .glb)");
    Json value;
    value.kind = kind;
    value.line = line();
    value.number = number;
    if (open_.empty()) {
      root = std::move(value);
      return root;
    }
    Json& parent = *open_.back();
    if (parent.kind == Json::Kind::list) {
      auto& list = of<std::vector<Json>>(parent);
      list.push_back(std::move(value));
      return list.back();
    }
    auto& members = of<std::vector<std::pair<std::string, Json>>>(parent);
    members.emplace_back(std::move(key_), std::move(value));
    return members.back().second;
  }

  template <class T>
  static T& of(Json& json) {
    if (!json.contents) json.contents = std::make_unique<Json::Contents>(Json::Contents{T()});
    return std::get<T>(json.contents->of);
  }

  bool open(Json::Kind kind) {
    if (open_.size() == deepest)
      refuse(path_, line(), "nested more than " + std::to_string(deepest) + " deep; write it flatter");
    open_.push_back(&add(kind, 0));  // stays where it is: nothing is added beside it until it is closed
    return true;
  }

  const std::string& path_;
  const Cursor::Place& place_;
  std::vector<Json*> open_;
  std::size_t values_ = 0;
  std::string key_;
};

const std::string no_text;
const std::vector<Json> no_list;
const std::vector<std::pair<std::string, Json>> no_members;

}  // namespace

const std::string& Json::text() const {
  const auto* text = contents ? std::get_if<std::string>(&contents->of) : nullptr;
  return text != nullptr ? *text : no_text;
}

const std::vector<Json>& Json::list() const {
  const auto* list = contents ? std::get_if<std::vector<Json>>(&contents->of) : nullptr;
  return list != nullptr ? *list : no_list;
}

const std::vector<std::pair<std::string, Json>>& Json::members() const {
  const auto* members =
      contents ? std::get_if<std::vector<std::pair<std::string, Json>>>(&contents->of) : nullptr;
  return members != nullptr ? *members : no_members;
}

const Json* Json::find(std::string_view key) const {
  for (const auto& [name, value] : members())
    if (name == key) return &value;
  return nullptr;
}

const char* kind_name(Json::Kind kind) {
  constexpr const char* names[] = {"null", "true or false", "a number", "text", "a list", "an object"};
  return names[static_cast<int>(kind)];
}

Json parse_json(const std::string& path, std::string_view text) {
  if (text.size() > most_json_bytes)
    refuse(path, 0,
           "JSON of " + std::to_string(text.size()) + " bytes; " + std::to_string(most_json_bytes) +
               " are the most");
  if (text.substr(0, 3) == "\xef\xbb\xbf") text.remove_prefix(3);
  if (const std::size_t nul = text.find('\0'); nul != text.npos) {  // the parser takes it for the end
    const auto line = 1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(nul), '\n');
    refuse(path, std::size_t(line), "is no JSON: a byte that is NUL; a text file is wanted");
  }
  Cursor::Place place;
  Builder builder(path, place);
  nlohmann::json::sax_parse(Cursor(text.data(), &place), Cursor(text.data() + text.size(), nullptr),
                            &builder);
  return std::move(builder.root);
}

Members::Members(const std::string& path, const Json& object, const char* what,
                 std::span<const std::string_view> known)
    : path_(path), object_(object), what_(what) {
  if (object.kind != Json::Kind::object)
    refuse(path, object.line,
           std::string(what) + " is an object in braces; this is " + kind_name(object.kind));
  if (known.size() == 0) return;
  for (const auto& [key, value] : object.members()) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    std::string names;
    for (const std::string_view name : known) names += (names.empty() ? "" : ", ") + std::string(name);
    refuse(path, value.line, in_quotes(key) + " is no key of " + what + "; it has " + names);
  }
}

const Json& Members::need(std::string_view key) const {
  const Json* found = find(key);
  if (found == nullptr)
    refuse(path_, object_.line, std::string(what_) + " has no " + in_quotes(key) + "; it needs one");
  return *found;
}

void Members::refuse_key(std::string_view key, const std::string& what) const {
  const Json* found = find(key);
  refuse(path_, found != nullptr ? found->line : object_.line, in_quotes(key) + " of " + what_ + " " + what);
}

double Members::number(std::string_view key, double otherwise, double low, double high) const {
  const Json* found = find(key);
  if (found == nullptr) return otherwise;
  if (found->kind != Json::Kind::number)
    refuse_key(key, std::string("is ") + kind_name(found->kind) + "; it takes a number");
  if (!(found->number >= low && found->number <= high))
    refuse_key(key, "is " + shown(found->number) + "; it goes from " + shown(low) + " to " + shown(high));
  return found->number;
}

bool Members::flag(std::string_view key, bool otherwise) const {
  const Json* found = find(key);
  if (found == nullptr) return otherwise;
  if (found->kind != Json::Kind::boolean)
    refuse_key(key, std::string("is ") + kind_name(found->kind) + "; it takes true or false");
  return found->number != 0;
}

std::int64_t Members::whole(std::string_view key, std::int64_t otherwise, std::int64_t low,
                            std::int64_t high) const {
  const double value = number(key, double(otherwise), double(low), double(high));
  if (value != std::floor(value)) refuse_key(key, "is " + shown(value) + "; it takes a whole number");
  return static_cast<std::int64_t>(value);
}

std::string Members::text(std::string_view key, const std::string& otherwise) const {
  const Json* found = find(key);
  if (found == nullptr) return otherwise;
  if (found->kind != Json::Kind::text)
    refuse_key(key, std::string("is ") + kind_name(found->kind) + "; it takes text in quotes");
  return found->text();
}

dvec3 Members::vector(std::string_view key, const dvec3& otherwise, double low, double high) const {
  const Json* found = find(key);
  if (found == nullptr) return otherwise;
  const std::vector<double> three = numbers(path_, *found, key, 3, low, high);
  return {three[0], three[1], three[2]};
}

const std::vector<Json>& Members::list(std::string_view key) const {
  const Json* found = find(key);
  if (found == nullptr) return no_list;
  if (found->kind != Json::Kind::list)
    refuse_key(key, std::string("is ") + kind_name(found->kind) + "; it takes a list in brackets");
  return found->list();
}

std::vector<double> numbers(const std::string& path, const Json& list, std::string_view key,
                            std::size_t count, double low, double high) {
  const std::string wanted = in_quotes(key) + " takes a list of " + std::to_string(count) + " numbers";
  if (list.kind != Json::Kind::list) refuse(path, list.line, wanted + "; this is " + kind_name(list.kind));
  if (list.list().size() != count)
    refuse(path, list.line, wanted + "; this one has " + std::to_string(list.list().size()));
  std::vector<double> result;
  for (const Json& value : list.list()) {
    if (value.kind != Json::Kind::number)
      refuse(path, value.line, wanted + "; one is " + kind_name(value.kind));
    if (!(value.number >= low && value.number <= high))
      refuse(path, value.line,
             "a number of " + in_quotes(key) + " is " + shown(value.number) + "; they go from " + shown(low) +
                 " to " + shown(high));
    result.push_back(value.number);
  }
  return result;
}

}  // namespace trilha
