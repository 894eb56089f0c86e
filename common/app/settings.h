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

  /// The value as a word or number, as the command line takes it.
  std::string text() const;
  /// Sets the value from such a text. Throws UsageError if it is no such value, InputError if it is out of
  /// range.
  void set_text(const std::string& text) const;
};

class Settings {
 public:
  void flag(const std::string& name, bool& value, Effect effect, const std::string& help);
  void integer(const std::string& name, int& value, int low, int high, Effect effect,
               const std::string& help);
  void number(const std::string& name, float& value, float low, float high, Effect effect,
              const std::string& help);
  template <class Enum>
  void choice(const std::string& name, Enum& value, std::vector<Choice> choices, Effect effect,
              const std::string& help) {
    add({name, help, Setting::Kind::choice, effect, 0, 0, std::move(choices),
         [&value] { return static_cast<double>(value); },
         [&value](double x) { value = static_cast<Enum>(static_cast<int>(x)); }});
  }

  const std::vector<Setting>& all() const { return settings_; }
  /// Throws std::out_of_range for an unknown name.
  const Setting& operator[](const std::string& name) const;

 private:
  void add(Setting setting);

  std::vector<Setting> settings_;
};

}  // namespace trilha
