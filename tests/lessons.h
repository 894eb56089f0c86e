#pragma once
// What a chapter's program says, against its lesson.

#include <fstream>
#include <set>
#include <string>

#include "common/app/demo.h"
#include "common/scene/library.h"
#include "tests/testing.h"

namespace trilha::testing {

/// Every setting of the chapter stands in a group, is explained by a heading ("## …") that its README has,
/// and says in a sentence what it is, each of its choices too.
inline void check_lessons(Demo& demo) {
  Settings settings;
  demo.declare_settings(settings);
  std::set<std::string> headings;
  std::ifstream lesson(root_folder() / "chapters" / demo.name().first / "README.md");
  for (std::string line; std::getline(lesson, line);)
    if (line.rfind("## ", 0) == 0) headings.insert(line.substr(3));
  REQUIRE(headings.size() > 3);
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

}  // namespace trilha::testing
