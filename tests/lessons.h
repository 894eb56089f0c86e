#pragma once
// What a chapter's program says, against its lesson.

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "common/app/demo.h"
#include "common/scene/library.h"
#include "tests/testing.h"

namespace trilha::testing {

/// The headings ("## …") of a chapter's README.
inline std::set<std::string> headings_of(const std::string& chapter) {
  std::set<std::string> headings;
  std::ifstream lesson(root_folder() / "chapters" / chapter / "README.md");
  for (std::string line; std::getline(lesson, line);)
    if (line.rfind("## ", 0) == 0) headings.insert(line.substr(3));
  return headings;
}

/// Every setting of the chapter stands in a group, is explained by a heading that its README has, or that of
/// an earlier chapter on which it builds, and says in a sentence what it is, each of its choices too.
inline void check_lessons(Demo& demo) {
  Settings settings;
  demo.declare_settings(settings);
  const std::string chapter = demo.name().first;
  REQUIRE(headings_of(chapter).size() > 3);
  std::set<std::string> headings;
  for (const auto& folder : std::filesystem::directory_iterator(root_folder() / "chapters"))
    if (const std::string one = folder.path().filename().string(); one <= chapter)
      headings.merge(headings_of(one));
  REQUIRE_FALSE(settings.all().empty());
  for (const Setting& setting : settings.all()) {
    INFO("--" << setting.name << ", explained under '" << setting.lesson << "'");
    CHECK_FALSE(setting.group.empty());
    CHECK(headings.count(setting.lesson) == 1);
    CHECK(setting.help.size() > 20);
    for (const Choice& choice : setting.choices) CHECK(choice.help.size() > 10);
    CHECK(setting.only.empty() == !setting.applies);
  }
}

/// Texts worth trying of a setting.
inline std::vector<std::string> texts_of(const Setting& setting) {
  switch (setting.kind) {
    case Setting::Kind::flag:
      return {"true", "false"};
    case Setting::Kind::choice: {
      std::vector<std::string> all;
      for (const Choice& choice : setting.choices) all.push_back(choice.name);
      return all;
    }
    case Setting::Kind::integer:
      return {std::to_string(int(setting.low)), std::to_string(int(setting.low) + 3)};
    default:
      return {setting.low > 0.02 ? "2.5" : "0.02", "0.37"};
  }
}

/// Every setting has a name of its own, and reads back each value that it takes, as does another demo.
inline void check_read_back(std::unique_ptr<Demo> (*make)()) {
  const std::unique_ptr<Demo> demo = make(), other_demo = make();
  Settings settings, other;
  demo->declare_settings(settings);
  other_demo->declare_settings(other);
  std::set<std::string> names;
  for (const Setting& setting : settings.all()) {
    INFO("--" << setting.name);
    CHECK(names.insert(setting.name).second);
    std::vector<std::string> texts = texts_of(setting);
    if (setting.kind == Setting::Kind::integer || setting.kind == Setting::Kind::number)
      for (const double end : {setting.low, setting.high}) {
        setting.put(end);
        texts.push_back(setting.text());
      }
    for (const std::string& text : texts) {
      setting.set_text(text);
      CHECK(setting.text() == text);
      other.set_texts(settings.texts());
      CHECK(other.texts() == settings.texts());
    }
    setting.set_text(setting.initial_text());
    CHECK_FALSE(setting.changed());
    CHECK_THROWS(setting.set_text("no such value"));
  }
}

}  // namespace trilha::testing
