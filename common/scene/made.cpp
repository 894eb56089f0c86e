#include "common/scene/made.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "common/error.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

std::string listed(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

}  // namespace

Parameters::Parameters(const std::string& scene, const std::vector<Parameter>& declared,
                       std::string_view text, const LoadOptions& options)
    : values_(declared), textures_(options.textures) {
  std::set<std::string_view> seen;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(','));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    const std::size_t equals = word.find('=');
    const std::string_view name = word.substr(0, equals);
    const auto found =
        std::find_if(values_.begin(), values_.end(), [&](const Parameter& p) { return name == p.name; });
    if (found == values_.end()) {
      std::vector<std::string> names;
      for (const Parameter& p : values_) names.push_back(p.name);
      refuse(scene, 0,
             in_quotes(name) + " is no parameter of it; it has " + (names.empty() ? "none" : listed(names)));
    }
    const std::string where = scene + ":" + found->name;
    if (!seen.insert(name).second) refuse(where, 0, "given twice; give it once");
    if (equals == word.npos)
      refuse(where, 0, "no value; write " + std::string(name) + "=" + shown(found->value));
    const std::string_view said = word.substr(equals + 1);
    const auto choice = std::find(found->words.begin(), found->words.end(), said);
    if (choice != found->words.end()) {
      found->value = found->low + static_cast<double>(choice - found->words.begin());
      continue;
    }
    if (!found->words.empty() && said.find_first_not_of("0123456789") != said.npos)
      refuse(where, 0, in_quotes(said) + " is none of its words; it takes " + listed(found->words));
    const double value = parse_number(said, where, 0);
    if (!(value >= found->low && value <= found->high))
      refuse(
          where, 0,
          shown(value) + " is out of range; it goes from " + shown(found->low) + " to " + shown(found->high));
    if (found->whole && value != std::floor(value))
      refuse(where, 0, shown(value) + " is no whole number; write one");
    found->value = value;
  }
}

double Parameters::operator[](std::string_view name) const {
  for (const Parameter& p : values_)
    if (name == p.name) return p.value;
  throw std::logic_error("no parameter is called " + std::string(name));
}

int Parameters::whole(std::string_view name) const { return static_cast<int>((*this)[name]); }

const std::vector<MadeScene>& made_scenes() {
  static const std::vector<MadeScene> all = [] {
    std::vector<MadeScene> list;
    for (const auto& some : {tea_scenes(), box_and_shape_scenes(), hall_scenes(), whitted_scenes(),
                             still_life_scenes(), loggia_scenes(), feature_scenes(), extreme_scenes()})
      list.insert(list.end(), some.begin(), some.end());
    return list;
  }();
  return all;
}

}  // namespace trilha
