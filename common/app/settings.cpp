#include "common/app/settings.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "common/app/words.h"
#include "common/error.h"

namespace trilha {
namespace {

/// The shortest text that reads back as x exactly: as a float, or as the whole number that it is.
std::string number_text(double x, Setting::Kind kind) {
  return kind == Setting::Kind::integer ? std::to_string(static_cast<long long>(x))
                                        : shortest(static_cast<float>(x));
}

template <class T>
std::from_chars_result read(const std::string& text, T& value) {
  return std::from_chars(text.data(), text.data() + text.size(), value);
}

}  // namespace

std::string Setting::text_of(double value) const {
  if (kind == Kind::flag) return value != 0 ? "true" : "false";
  if (kind != Kind::choice) return number_text(value, kind);
  for (const Choice& choice : choices)
    if (choice.value == value) return choice.name;
  throw std::logic_error(name + " holds a value that is none of its choices");
}

void Setting::set_text(const std::string& text) const {
  const std::string refused = "--" + name + ": '" + text + "' ";
  if (kind == Kind::flag) {
    if (text != "true" && text != "false") throw UsageError(refused + "is neither true nor false");
    return put(text == "true");
  }
  if (kind == Kind::choice) {
    std::string names;
    for (const Choice& choice : choices) {
      if (choice.name == text) return put(choice.value);
      names += (names.empty() ? "" : ", ") + choice.name;
    }
    throw UsageError(refused + "is none of its values; choose one of " + names);
  }
  double x = 0;
  const auto [end, error] = read(text, x);
  if (error != std::errc() || end != text.data() + text.size()) throw UsageError(refused + "is no number");
  if (kind == Kind::integer && x != std::floor(x)) throw UsageError(refused + "is no whole number");
  // rounded once, from the text: a double between could round the other way
  if (float single = 0; kind == Kind::number && read(text, single).ec == std::errc()) x = single;
  if (!(x >= low && x <= high))
    throw InputError(refused + "is out of range; it goes from " + number_text(low, kind) + " to " +
                     number_text(high, kind));
  put(x);
}

void Setting::only_if(std::function<bool()> condition, const std::string& when) {
  applies = std::move(condition);
  only = when;
}

void Settings::group(const std::string& heading, const std::string& lesson) {
  group_ = heading;
  lesson_ = lesson;
}

Setting Settings::of_kind(Setting::Kind kind, const std::string& name, Effect effect,
                          const std::string& help) const {
  Setting setting{};
  setting.name = name;
  setting.help = help;
  setting.kind = kind;
  setting.effect = effect;
  setting.group = group_;
  setting.lesson = lesson_;
  return setting;
}

Setting& Settings::flag(const std::string& name, bool& value, Effect effect, const std::string& help) {
  Setting setting = of_kind(Setting::Kind::flag, name, effect, help);
  setting.get = [&value] { return value; };
  setting.put = [&value](double x) { value = x != 0; };
  return add(std::move(setting));
}

Setting& Settings::integer(const std::string& name, int& value, int low, int high, Effect effect,
                           const std::string& help) {
  Setting setting = of_kind(Setting::Kind::integer, name, effect, help);
  setting.low = low, setting.high = high;
  setting.get = [&value] { return value; };
  setting.put = [&value](double x) { value = static_cast<int>(x); };
  return add(std::move(setting));
}

Setting& Settings::number(const std::string& name, float& value, float low, float high, Effect effect,
                          const std::string& help) {
  Setting setting = of_kind(Setting::Kind::number, name, effect, help);
  setting.low = low, setting.high = high;
  setting.get = [&value] { return value; };
  setting.put = [&value](double x) { value = static_cast<float>(x); };
  return add(std::move(setting));
}

const Setting& Settings::operator[](const std::string& name) const {
  for (const Setting& setting : settings_)
    if (setting.name == name) return setting;
  throw std::out_of_range("no setting is called " + name);
}

std::vector<std::string> Settings::texts() const {
  std::vector<std::string> texts;
  for (const Setting& setting : settings_) texts.push_back(setting.text());
  return texts;
}

void Settings::set_texts(const std::vector<std::string>& texts) const {
  for (std::size_t i = 0; i < settings_.size(); ++i) settings_[i].set_text(texts.at(i));
}

Effect Settings::difference(const std::vector<std::string>& before,
                            const std::vector<std::string>& after) const {
  Effect effect = Effect::none;
  for (std::size_t i = 0; i < settings_.size(); ++i)
    if (before.at(i) != after.at(i)) effect = std::max(effect, settings_[i].effect);
  return effect;
}

Setting& Settings::add(Setting setting) {
  for (const Setting& other : settings_)
    if (other.name == setting.name) throw std::logic_error("two settings are called " + setting.name);
  setting.initial = setting.get();
  settings_.push_back(std::move(setting));
  return settings_.back();
}

std::vector<std::string> idle_settings(const Settings& settings) {
  std::vector<std::string> lines;
  for (const Setting& setting : settings.all()) {
    if (!setting.changed() || setting.active()) continue;
    const bool switched_off = setting.kind == Setting::Kind::flag && setting.get() == 0;
    lines.push_back((switched_off ? "--no-" : "--") + setting.name + " has no effect here: " + setting.only);
  }
  return lines;
}

}  // namespace trilha
