#include "common/scene/mtl.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <span>
#include <utility>

#include "common/scene/text.h"

namespace trilha {
namespace {

constexpr float largest = 1e6f;  // of colours and exponents

enum class Wants : std::uint8_t {
  colour,       // 1 or 3 numbers, or a spectrum
  filter,       // the same, from 0 to 1
  number,       // one number from `low` to `high`
  map,          // options and a file
  ignored,      // numbers, words: whatever
  ignored_map,  // options and a file
};

/// A statement that is known.
struct Known {
  std::string_view keyword;
  Wants wants;
  float low = 0, high = 1;
};

constexpr Known known[] = {
    {"Ka", Wants::colour},
    {"Kd", Wants::colour},
    {"Ks", Wants::colour},
    {"Ke", Wants::colour},
    {"Kt", Wants::filter},
    {"Tf", Wants::filter},
    {"Ns", Wants::number, 0, largest},
    {"Ni", Wants::number, 0, 100},
    {"d", Wants::number},
    {"Tr", Wants::number},
    {"illum", Wants::number, 0, 10},
    {"r", Wants::number},
    {"Pr", Wants::number},
    {"Pm", Wants::number},
    {"map_Kd", Wants::map},
    {"map_Ks", Wants::map},
    {"map_Ke", Wants::map},
    {"map_d", Wants::map},
    {"map_Pr", Wants::map},
    {"map_Pm", Wants::map},
    {"map_Bump", Wants::map},
    {"map_bump", Wants::map},
    {"bump", Wants::map},
    {"norm", Wants::map},
    {"Ps", Wants::ignored},
    {"Pc", Wants::ignored},
    {"Pcr", Wants::ignored},
    {"aniso", Wants::ignored},
    {"anisor", Wants::ignored},
    {"sharpness", Wants::ignored},
    {"map_aat", Wants::ignored},
    {"map_Ka", Wants::ignored_map},
    {"map_Ns", Wants::ignored_map},
    {"map_Ps", Wants::ignored_map},
    {"decal", Wants::ignored_map},
    {"disp", Wants::ignored_map},
    {"refl", Wants::ignored_map},
};

std::string written(float value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace

void Listed::add(std::string_view name) {
  if (++count_ <= most) text_ += (text_.empty() ? "" : ", ") + in_quotes(name);
}

std::string Listed::text() const {
  return count_ <= most ? text_ : text_ + " and " + std::to_string(count_ - most) + " more";
}

/// Reads one library.
class MaterialLibraries::Reader {
 public:
  Reader(const std::string& path, MaterialLibraries& libraries)
      : path_(path), libraries_(libraries), file_(path), statements_(file_) {
    while (statements_.next()) statement();
    if (!any_)
      refuse(path_, 0, "no material in it; a library has lines like \"newmtl red\" and \"Kd 1 0 0\"");
  }

  void warn(std::vector<std::string>& warnings) const {
    std::string ignored;
    for (const auto& [what, count] : ignored_)
      ignored += (ignored.empty() ? "" : ", ") + what + " (" + std::to_string(count) + ")";
    if (!ignored.empty()) warnings.push_back(path_ + ": ignored: " + ignored);
    if (others_ > 0)
      warnings.push_back(path_ + ": " + counted(others_, "unknown statement") + " ignored, the first " +
                         first_other_);
    if (repeated_ > 0)
      warnings.push_back(path_ + ": " + counted(repeated_, "material") +
                         " defined before: the first of a name holds");
    if (no_index_ > 0)
      warnings.push_back(path_ + ": " + counted(no_index_, "Ni") + " of 0 taken for none: 1.5 instead");
  }

 private:
  [[noreturn]] void refuse_here(const std::string& what) { refuse(path_, statements_.line(), what); }

  void statement() {
    const std::string_view keyword = statements_.word();
    if (keyword == "newmtl") {
      const std::string name(statements_.rest());
      if (name.empty()) refuse_here("newmtl without a name; write it like \"newmtl red\"");
      any_ = true;
      const auto [found, is_new] = libraries_.definitions_.try_emplace(name);
      repeated_ += !is_new;
      unused_ = {};
      current_ = is_new ? &found->second : &unused_;
      current_->library = path_;
      current_->line = statements_.line();
      return;
    }
    const auto* const found = std::find_if(std::begin(known), std::end(known),
                                           [&](const Known& k) { return k.keyword == keyword; });
    if (found == std::end(known)) {
      if (others_++ == 0)
        first_other_ = in_quotes(keyword) + " in line " + std::to_string(statements_.line());
      return;
    }
    if (current_ == nullptr)
      refuse_here(std::string(keyword) + " before any newmtl; name the material first");
    switch (found->wants) {
      case Wants::colour:
        return colour(found->keyword, largest);
      case Wants::filter:
        return colour(found->keyword, 1);
      case Wants::number:
        return number(*found);
      case Wants::map:
        return map(found->keyword);
      case Wants::ignored:
        return ignore(found->keyword);
      case Wants::ignored_map:
        ignore(found->keyword);
        map_statement(found->keyword);
        return;
    }
  }

  void ignore(std::string_view what) { ++ignored_[std::string(what)]; }

  float ranged(std::string_view keyword, std::string_view word, float low, float high) {
    const float value = parse_float(word, path_, statements_.line());
    if (!(value >= low && value <= high))
      refuse_here(std::string(keyword) + " of " + in_quotes(word) + " is out of its range; it goes from " +
                  written(low) + " to " + written(high));
    return value;
  }

  void colour(std::string_view keyword, float high) {
    statements_.drop_comment();
    vec3 value(0);
    int count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count) {
      if (count == 0 && (word == "spectral" || word == "xyz"))
        return ignore(std::string(keyword) + " " + std::string(word));
      const float component = ranged(keyword, word, 0, high);
      if (count < 3) value[count] = component;
    }
    if (count == 1) value = vec3(value.x);
    if (count != 1 && count != 3)
      refuse_here(std::string(keyword) + " with " + counted(static_cast<std::size_t>(count), "number") +
                  "; it takes 3, or 1 for grey");
    if (keyword == "Kd") current_->diffuse = value;
    if (keyword == "Ks") current_->specular = value;
    if (keyword == "Ke") current_->emission = value;
    if (keyword == "Kt") current_->transmission = value;
    if (keyword == "Tf") current_->filter = value;
  }

  void number(const Known& what) {
    statements_.drop_comment();
    std::string_view word = statements_.word();
    if (what.keyword == "d" && word == "-halo") {
      ignore("-halo");
      word = statements_.word();
    }
    std::size_t count = !word.empty();
    const float value = word.empty() ? 0 : ranged(what.keyword, word, what.low, what.high);
    while (!statements_.word().empty()) ++count;
    if (count != 1)
      refuse_here(std::string(what.keyword) + " with " + counted(count, "number") + "; it takes 1");
    if (what.keyword == "Ns") current_->shininess = value;
    if (what.keyword == "d") current_->dissolve = value;
    if (what.keyword == "Tr") current_->dissolve = 1 - value;
    if (what.keyword == "r") current_->reflection = value;
    if (what.keyword == "Pr") current_->roughness = value;
    if (what.keyword == "Pm") current_->metallic = value;
    if (what.keyword == "Ni") {
      if (value == 0) {
        ++no_index_;
      } else if (value < 0.001f) {
        refuse_here("Ni of " + in_quotes(word) + " is out of its range; it goes from 0.001 to 100");
      } else {
        current_->refraction_index = value;
      }
    }
    if (what.keyword == "illum") {
      if (value != std::floor(value))
        refuse_here("illum of " + in_quotes(word) + " is no illumination model; they are 0 to 10");
      current_->illumination = static_cast<int>(value);
    }
  }

  void map(std::string_view keyword) {
    static constexpr std::pair<std::string_view, Slot> slots_of[] = {
        {"map_Kd", diffuse},   {"map_Ks", specular}, {"map_Ke", emission}, {"map_d", opacity},
        {"map_Pr", roughness}, {"map_Pm", metallic}, {"map_Bump", bump},   {"map_bump", bump},
        {"bump", bump},        {"norm", normal},
    };
    const auto* const slot = std::find_if(std::begin(slots_of), std::end(slots_of),
                                          [&](const auto& pair) { return pair.first == keyword; });
    current_->maps[slot->second] = map_statement(keyword);
  }

  /// Options, then the file: all that is left of the statement, whose name may hold spaces.
  MapStatement map_statement(std::string_view keyword) {
    MapStatement map;
    map.line = statements_.line();
    left_ = statements_.rest();
    while (left_.starts_with('-')) option(keyword, taken(), map);
    map.file = left_;
    if (map.file.empty())
      refuse_here(std::string(keyword) + " without a file; write it like \"" + std::string(keyword) +
                  " wood.png\"");
    return map;
  }

  std::string_view first_left() const { return left_.substr(0, left_.find_first_of(" \t")); }

  /// The first word of what is left, which it leaves.
  std::string_view taken() {
    const std::string_view word = first_left();
    left_.remove_prefix(word.size());
    left_.remove_prefix(std::min(left_.find_first_not_of(" \t"), left_.size()));
    return word;
  }

  void option(std::string_view keyword, std::string_view name, MapStatement& map) {
    const auto next_word = [&](const char* wanted) {
      const std::string_view word = taken();
      if (left_.empty())
        refuse_here(std::string(name) + " of " + std::string(keyword) + " is cut short; " + wanted +
                    " and a file are to follow");
      return word;
    };
    const auto next_number = [&] { return parse_float(next_word("a number"), path_, statements_.line()); };
    const auto one_of = [&](std::initializer_list<std::string_view> words, const char* wanted) {
      const std::string_view word = next_word(wanted);
      const auto* const found = std::find(words.begin(), words.end(), word);
      if (found == words.end())
        refuse_here(std::string(name) + " " + in_quotes(word) + " is not known; write " + wanted);
      return static_cast<int>(found - words.begin());
    };
    // Up to three numbers, as far as they are numbers and not the file.
    const auto up_to_three = [&](float otherwise) {
      vec3 numbers(next_number(), otherwise, otherwise);
      for (int i = 1; i < 3 && first_left().size() < left_.size() && is_number(first_left()); ++i)
        numbers[i] = next_number();
      return numbers;
    };
    if (name == "-s") {
      map.scale = vec2(up_to_three(1));
    } else if (name == "-o") {
      map.offset = vec2(up_to_three(0));
    } else if (name == "-t") {
      if (up_to_three(0) != vec3(0)) ignore(name);
    } else if (name == "-mm") {
      const float base = next_number();
      map.gain = next_number();
      // of heights only differences count
      if (base != 0 && keyword != "bump" && keyword != "map_bump" && keyword != "map_Bump") {
        ignore(name);
        map.gain = 1;
      }
    } else if (name == "-bm") {
      map.bump = next_number();
    } else if (name == "-clamp") {
      map.clamp = one_of({"on", "off"}, "on or off") == 0;
    } else if (name == "-blendu" || name == "-blendv") {
      if (one_of({"on", "off"}, "on or off") == 1) ignore(name);
    } else if (name == "-cc") {
      if (one_of({"on", "off"}, "on or off") == 0) ignore(name);
    } else if (name == "-imfchan") {
      const int channel = one_of({"r", "g", "b", "m", "l", "z"}, "one of r g b m l z");
      map.channel = static_cast<std::int8_t>(channel == 4 ? 0 : channel);  // grey is the same in all
      if (channel == 5) {
        ignore("-imfchan z");
        map.channel = -1;
      }
    } else if (name == "-boost" || name == "-texres") {
      const std::string_view word = next_word("a number");
      if (parse_float(word, path_, statements_.line()) < 0)
        refuse_here(std::string(name) + " of " + in_quotes(word) + " is negative; 0 is the least");
      ignore(name);
    } else if (name == "-type") {
      one_of({"sphere", "cube_top", "cube_bottom", "cube_front", "cube_back", "cube_left", "cube_right"},
             "sphere or one of cube_top, _bottom, _front, _back, _left and _right");
      ignore(name);
    } else {
      refuse_here(in_quotes(name) + " is no option of a map; -s -o -t -mm -bm -clamp -imfchan … are");
    }
  }

  static bool is_number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0;
    const char* const end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    return error != std::errc::invalid_argument && stop == end;
  }

  const std::string& path_;
  MaterialLibraries& libraries_;
  TextFile file_;
  Statements statements_;
  std::string_view left_;  // of a map statement
  Definition* current_ = nullptr;
  Definition unused_;  // of a name that was there before
  bool any_ = false;
  std::size_t others_ = 0, repeated_ = 0, no_index_ = 0;
  std::string first_other_;
  std::map<std::string, std::size_t> ignored_;
};

void MaterialLibraries::read(const std::string& path, std::vector<std::string>& warnings) {
  Reader(path, *this).warn(warnings);
}

Material MaterialLibraries::made(const std::string& name, const Definition& definition) {
  const auto or_one = [&](Slot slot, vec3 otherwise) {
    return definition.maps[slot].file.empty() ? otherwise : vec3(1);
  };
  Material material;
  material.name = name;
  material.diffuse = definition.diffuse.value_or(or_one(diffuse, material.diffuse));
  material.specular = definition.specular.value_or(or_one(specular, material.specular));
  material.emission = definition.emission.value_or(or_one(emission, material.emission));
  material.shininess = definition.shininess.value_or(material.shininess);
  material.refraction_index = definition.refraction_index.value_or(material.refraction_index);
  if (definition.shininess && definition.maps[roughness].file.empty())
    material.roughness = static_cast<float>(std::sqrt(std::sqrt(2 / (double(*definition.shininess) + 2))));
  material.roughness = definition.roughness.value_or(material.roughness);
  material.metallic = definition.metallic.value_or(or_one(metallic, vec3(0)).x);
  material.opacity = definition.dissolve.value_or(1);

  const int model = definition.illumination.value_or(-1);
  const bool is_glass = model == 4 || model == 6 || model == 7 || model == 9;
  const bool dissolves = material.opacity < 1;
  if (definition.reflection) {
    material.reflection = vec3(*definition.reflection);
  } else if (model == 3 || model == 5 || model == 6 || model == 7 || (model == 4 && dissolves)) {
    material.reflection = glm::min(material.specular, vec3(1));
  }
  if (is_glass || definition.reflection || (model < 0 && definition.transmission)) {
    const vec3 filter = definition.filter.value_or(vec3(1));
    if (definition.transmission) {
      material.transmission = *definition.transmission;
    } else if (definition.filter && (model == 6 || model == 7)) {
      material.transmission = (1.0f - material.reflection) * filter;
    } else {
      material.transmission = (1 - material.opacity) * filter;
    }
    if (material.transmission != vec3(0)) {
      material.diffuse *= material.opacity;
      material.opacity = 1;
    }
  }
  return material;
}

std::optional<vec3> MaterialLibraries::light_of(const std::string& name) const {
  const auto found = definitions_.find(name);
  if (found == definitions_.end()) return std::nullopt;
  const Definition& definition = found->second;
  if (definition.emission && *definition.emission != vec3(0)) return definition.emission;
  return definition.diffuse.value_or(Material{}.diffuse);
}

std::optional<Material> MaterialLibraries::material(const std::string& name, TextureSet& textures,
                                                    const LoadOptions& options, Scene& scene) {
  const auto found = definitions_.find(name);
  if (found == definitions_.end()) return std::nullopt;
  const Definition& definition = found->second;
  Material material = made(name, definition);
  Map* const maps[slots] = {&material.diffuse_map, &material.specular_map,  &material.emission_map,
                            &material.opacity_map, &material.roughness_map, &material.metallic_map,
                            &material.bump_map,    &material.normal_map};
  const std::span<float> beside[slots] = {{&material.diffuse.x, 3},
                                          {&material.specular.x, 3},
                                          {&material.emission.x, 3},
                                          {&material.opacity, 1},
                                          {&material.roughness, 1},
                                          {&material.metallic, 1},
                                          {},
                                          {}};
  for (int slot = 0; slot < slots; ++slot) {
    const MapStatement& said = definition.maps[slot];
    if (said.file.empty()) continue;
    const std::filesystem::path file = named_file(said.file, definition.library, said.line, options);
    const bool is_colour = slot == diffuse || slot == specular || slot == emission;
    const Wrap wrap = said.clamp ? Wrap::clamp : Wrap::repeat;
    Map& map = *maps[slot];
    map.texture = textures.add(file, {is_colour ? TextureUse::colour : TextureUse::data, wrap, wrap},
                               definition.library, said.line);
    map.scale = said.scale;
    map.offset = said.offset;
    const bool is_number = !is_colour && slot != normal;
    if (is_number && said.channel >= 0) {
      map.channel = said.channel;
    } else if (slot == opacity && map && scene.textures[static_cast<std::size_t>(map.texture)].has_alpha) {
      map.channel = 3;
    }
    if (slot == bump || (slot == normal && definition.maps[bump].file.empty()))
      material.bump_scale = said.bump * said.gain;
    // -mm multiplies the map's values: so much the number that stands beside it.
    const std::span<float> numbers = beside[slot];
    const bool fits = std::all_of(numbers.begin(), numbers.end(), [&](float number) {
      return said.gain >= 0 && number * said.gain <= (is_number ? 1 : largest);
    });
    for (float& number : numbers) number *= fits ? said.gain : 1;
    if (!fits) beyond_range_.add(name, definition.library, said.line);
  }
  if (material.opacity == 0) invisible_.add(name, definition.library, definition.line);
  return material;
}

void MaterialLibraries::Remark::add(const std::string& name, const std::string& library, std::size_t line) {
  if (names.empty()) place = library + ":" + std::to_string(line) + ": ";
  names.add(name);
}

void MaterialLibraries::warn(std::vector<std::string>& warnings) const {
  if (!beyond_range_.names.empty()) {
    warnings.push_back(beyond_range_.place + "-mm ignored where its gain leads out of the range: material " +
                       beyond_range_.names.text());
  }
  if (!invisible_.names.empty()) {
    warnings.push_back(invisible_.place +
                       "not to be seen (d 0), where some programs write Tr 1 and mean d 1: " + "material " +
                       invisible_.names.text());
  }
}

}  // namespace trilha
