#include "common/app/settings.h"

#include "common/error.h"
#include "common/image/colour_map.h"
#include "common/image/image.h"
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

// Catches: a transfer function that is linear, or wrong at its ends; NaN that reaches a file.
TEST_CASE("colours are encoded as sRGB says") {
  CHECK(srgb_encoded(0) == 0);
  CHECK(srgb_encoded(1) == Approx(1));
  CHECK(srgb_encoded(0.214041f) == Approx(0.5).margin(1e-5));
  CHECK(srgb_encoded(0.002f) == Approx(0.02584));
  CHECK(srgb_encoded(-1) == 0);
  CHECK(srgb_encoded(7) == Approx(1));
  for (float x = 0; x <= 1; x += 1.0f / 64) CHECK(srgb_encoded(srgb_decoded(x)) == Approx(x).margin(1e-6));
  CHECK(srgb_encoded(std::nanf("")) == 0);
}

// Catches: a colour map that is not monotonic in lightness, which is what makes it readable without colour.
TEST_CASE("viridis grows lighter all the way") {
  float last = -1;
  for (int k = 0; k <= 100; ++k) {
    const vec3 c = viridis(static_cast<float>(k) / 100);
    const float lightness = 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
    CHECK(lightness > last);
    last = lightness;
  }
  CHECK(viridis(std::nanf("")) == vec3(1, 0, 1));
}
