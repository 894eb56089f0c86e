#include "common/app/settings.h"

#include <bit>
#include <cmath>

#include "common/error.h"
#include "common/math/random.h"
#include "tests/testing.h"

using namespace trilha;

namespace {

enum class Fruit { apple = 3, pear = 7 };

/// One setting of each kind.
struct Basket {
  Settings settings;
  bool flag = false, other = true;
  int count = 5;
  float size = 0.1f;
  Fruit fruit = Fruit::pear;

  Basket() {
    settings.flag("flag", flag, Effect::none, "a flag");
    settings.group("Numbers", "Of numbers");
    settings.integer("count", count, -2000000000, 2000000000, Effect::restart, "a count");
    settings.number("size", size, -1e38f, 1e38f, Effect::rebuild, "a size")
        .only_if([this] { return flag; }, "only with --flag");
    settings.group("Fruit");
    settings.choice("fruit", fruit, {{3, "apple", "round"}, {7, "pear", "not round"}}, Effect::none,
                    "a fruit");
    settings.flag("other", other, Effect::none, "on at first")
        .only_if([this] { return fruit == Fruit::pear; }, "only with --fruit pear");
  }
};

}  // namespace

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

// Catches: numbers that lose digits on their way through a text, of either kind.
TEST_CASE("all values go through texts unchanged, to another set of the same settings") {
  Basket a, b;
  Random random(7);
  for (int turn = 0; turn < 20000; ++turn) {
    a.flag = random.index(2) != 0;
    a.other = random.index(2) != 0;
    a.count = static_cast<int>(random.index(4000000001u) - 2000000000ll);
    a.fruit = random.index(2) != 0 ? Fruit::apple : Fruit::pear;
    do {
      a.size = std::bit_cast<float>(random.bits());
    } while (!(std::fabs(a.size) <= 1e38f));
    b.settings.set_texts(a.settings.texts());
    CHECK(b.settings.texts() == a.settings.texts());
    CHECK((b.flag == a.flag && b.other == a.other && b.count == a.count && b.fruit == a.fruit));
    CHECK(std::bit_cast<std::uint32_t>(b.size) == std::bit_cast<std::uint32_t>(a.size));
  }
  CHECK_THROWS_AS(a.settings.set_texts({"true"}), std::out_of_range);
  // just below the middle of two floats, which is the nearest double and would be rounded to the upper one
  a.settings["size"].set_text("1.00000017881393432617187499999");
  CHECK(a.size == 1 + 0x1p-23f);
}

// Catches: a change that asks for too little work, or for more than it needs.
TEST_CASE("the work that a change asks for is that of its largest effect") {
  Basket basket;
  const auto effect_of = [&](const std::vector<std::pair<std::string, std::string>>& changes) {
    const std::vector<std::string> before = Basket().settings.texts();
    basket.settings.set_texts(before);
    for (const auto& [name, text] : changes) basket.settings[name].set_text(text);
    return basket.settings.difference(before, basket.settings.texts());
  };
  CHECK(effect_of({}) == Effect::none);
  CHECK(effect_of({{"flag", "true"}, {"fruit", "apple"}}) == Effect::none);
  CHECK(effect_of({{"flag", "true"}, {"count", "6"}}) == Effect::restart);
  CHECK(effect_of({{"size", "2"}, {"count", "6"}}) == Effect::rebuild);
}

// Catches: a heading that settings before it or after the next one get.
TEST_CASE("settings stand under the heading that was said last") {
  const Basket basket;
  const auto& settings = basket.settings;
  CHECK(settings["flag"].group.empty());
  CHECK((settings["count"].group == "Numbers" && settings["count"].lesson == "Of numbers"));
  CHECK((settings["size"].group == "Numbers" && settings["size"].lesson == "Of numbers"));
  CHECK((settings["fruit"].group == "Fruit" && settings["fruit"].lesson.empty()));
  CHECK_THROWS_AS(settings["plum"], std::out_of_range);
}

// Catches: a setting that is said to change something where it does not, or the other way round; a warning
// about what nobody changed.
TEST_CASE("what was changed without effect is said, with what it needs") {
  Basket basket;
  CHECK(idle_settings(basket.settings).empty());
  CHECK_FALSE(basket.settings["size"].active());
  CHECK_FALSE(basket.settings["size"].changed());
  basket.size = 2;
  CHECK(idle_settings(basket.settings) ==
        std::vector<std::string>{"--size has no effect here: only with --flag"});
  basket.flag = true;
  CHECK(basket.settings["size"].active());
  CHECK(idle_settings(basket.settings).empty());
  basket.fruit = Fruit::apple;
  basket.other = false;
  CHECK(idle_settings(basket.settings) ==
        std::vector<std::string>{"--no-other has no effect here: only with --fruit pear"});
}
