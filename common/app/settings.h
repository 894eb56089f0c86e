#pragma once
// A setting is declared once, beside the variable that holds it; its command-line flag, its widget and its
// column in reports come from that declaration.

#include <functional>
#include <string>
#include <vector>

namespace trilha {

/// What has to be done again when a setting changes.
enum class Effect { none, restart, rebuild };

/// One named value among several, with the words that explain it.
struct Choice {
  int value;
  std::string name;
  std::string help;
};

struct Setting {
  enum class Kind { flag, integer, number, choice };

  std::string name;  ///< in kebab-case: the flag is --name
  std::string help;  ///< one sentence: what it does and what it costs
  Kind kind;
  Effect effect;
  double low = 0, high = 1;  ///< the range, both included, of integers and numbers
  std::vector<Choice> choices;
  std::function<double()> get;  ///< the value now; a choice's is the chosen entry's `value`
  std::function<void(double)> put;
  double initial = 0;
  std::string group;              ///< under which heading the panel shows it
  std::string lesson;             ///< the heading of the chapter's README that explains it
  std::function<bool()> applies;  ///< empty: always
  std::string only;               ///< when it applies, for people: "only with --shading lambert or normals"

  /// Does it change anything, as the other settings are?
  bool active() const { return !applies || applies(); }
  bool changed() const { return text() != initial_text(); }
  /// Such a value as words: "shading normals", "smooth", "not smooth".
  std::string in_words(const std::string& value) const {
    return kind == Kind::flag ? (value == "true" ? "" : "not ") + name : name + " " + value;
  }

  /// The value as a word or number, as the command line takes it: the shortest that reads back exactly.
  std::string text() const { return text_of(get()); }
  std::string initial_text() const { return text_of(initial); }
  /// It changes something only where the condition on other settings holds; `when` says which, for people.
  void only_if(std::function<bool()> condition, const std::string& when);
  /// Sets the value from such a text. Throws UsageError if it is no such value, InputError if it is out of
  /// range.
  void set_text(const std::string& text) const;

 private:
  std::string text_of(double value) const;
};

class Settings {
 public:
  /// Settings declared from now on stand under this heading, and are explained under that heading of the
  /// chapter's README.
  void group(const std::string& heading, const std::string& lesson = "");

  /// Each returns what it declared, to be refined by only_if before the next is declared.
  Setting& flag(const std::string& name, bool& value, Effect effect, const std::string& help);
  Setting& integer(const std::string& name, int& value, int low, int high, Effect effect,
                   const std::string& help);
  Setting& number(const std::string& name, float& value, float low, float high, Effect effect,
                  const std::string& help);
  template <class Enum>
  Setting& choice(const std::string& name, Enum& value, std::vector<Choice> choices, Effect effect,
                  const std::string& help) {
    Setting setting = of_kind(Setting::Kind::choice, name, effect, help);
    setting.choices = std::move(choices);
    setting.get = [&value] { return static_cast<double>(value); };
    setting.put = [&value](double x) { value = static_cast<Enum>(static_cast<int>(x)); };
    return add(std::move(setting));
  }

  const std::vector<Setting>& all() const { return settings_; }
  /// Throws std::out_of_range for an unknown name.
  const Setting& operator[](const std::string& name) const;

  /// All values as texts, in the order of declaration, and back: a set of settings that can be kept, compared
  /// and given to another demo of the same chapter. Throws std::out_of_range where there are fewer texts than
  /// settings, else what set_text throws.
  std::vector<std::string> texts() const;
  void set_texts(const std::vector<std::string>& texts) const;
  /// The largest effect of those settings whose texts differ.
  Effect difference(const std::vector<std::string>& before, const std::vector<std::string>& after) const;

 private:
  Setting of_kind(Setting::Kind kind, const std::string& name, Effect effect, const std::string& help) const;
  Setting& add(Setting setting);

  std::vector<Setting> settings_;
  std::string group_, lesson_;
};

/// A line for each setting that was changed and changes nothing, as the other settings are: "--smooth has no
/// effect here: only with --shading lambert or normals".
std::vector<std::string> idle_settings(const Settings& settings);

}  // namespace trilha
