#include "common/app/settings.h"

#include "common/error.h"
#include "tests/testing.h"

using namespace trilha;

namespace {
enum class Fruit { apple = 3, pear = 7 };
}

// Catches: a face of a setting that takes or shows another value than the others, a range not kept.
TEST_CASE("a setting reads back what it shows, and refuses the rest") {
  Settings settings;
  bool flag = false;
  int count = 5;
  float size = 0.1f;
  Fruit fruit = Fruit::pear;
  settings.flag("flag", flag, Effect::none, "a flag");
  settings.integer("count", count, 1, 10, Effect::restart, "a count");
  settings.number("size", size, 0, 1e6f, Effect::rebuild, "a size");
  settings.choice("fruit", fruit, {{3, "apple", "round"}, {7, "pear", "not round"}}, Effect::none, "a fruit");

  CHECK(settings["fruit"].text() == "pear");
  settings["fruit"].set_text("apple");
  CHECK(fruit == Fruit::apple);
  settings["flag"].set_text("true");
  CHECK(flag);
  settings["count"].set_text("10");
  CHECK(count == 10);
  for (const float value : {0.1f, 1.0f / 3, 123456.789f, 1e-30f}) {
    size = value;
    const std::string shown = settings["size"].text();
    size = 0;
    settings["size"].set_text(shown);
    CHECK(size == value);
  }
  for (const char* bad : {"", "x", "1x", "2.5", "nan", " 3"})
    CHECK_THROWS_AS(settings["count"].set_text(bad), UsageError);
  for (const char* bad : {"0", "11", "-5", "1e30"})
    CHECK_THROWS_AS(settings["count"].set_text(bad), InputError);
  CHECK_THROWS_AS(settings["size"].set_text("inf"), InputError);
  CHECK_THROWS_AS(settings["fruit"].set_text("plum"), UsageError);
  CHECK(count == 10);
  CHECK_THROWS(settings.flag("flag", flag, Effect::none, "again"));
}
