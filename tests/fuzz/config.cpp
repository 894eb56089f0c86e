// Configuration files, as --config reads them, for a chapter with a setting of each kind; and what was read,
// written and read again.

#include "common/app/command_line.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace trilha;

enum class Way { plain, blocked };

/// Declares settings, and does nothing else.
class Settled : public Demo {
 public:
  std::pair<std::string, std::string> name() const override { return {"fuzz_config", "Fuzzing"}; }
  void declare_settings(Settings& settings) override {
    settings.choice("loop", way_, {{0, "plain", "one by one"}, {1, "blocked", "many"}}, Effect::rebuild,
                    "the order");
    settings.flag("smooth", smooth_, Effect::restart, "interpolate");
    settings.integer("depth", depth_, 0, 16, Effect::restart, "of the recursion");
    settings.number("bias", bias_, -1, 1, Effect::restart, "moved by that");
  }
  void build(const Scene&, const Stream&) override {}
  bool add_sample(Film&, const SampleRequest&) override { return true; }
  double rays() const override { return 0; }
  std::vector<std::string> heatmaps() const override { return {"tests"}; }

 private:
  Way way_ = Way::plain;
  bool smooth_ = false;
  int depth_ = 4;
  float bias_ = 0;
};

/// What is said of the picture as a file of flags, read again, says the same.
void check_round_trip(const Options& options, const Settings& settings) {
  const std::vector<std::string> flags = flags_of(options, settings);
  std::string text;
  try {
    text = config_of(flags);
  } catch (const InputError&) {
    return;  // with its quotes a line may have become too long
  }
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  Settled demo;
  Settings again;
  demo.declare_settings(again);
  Options read;
  read_config_file(fuzz::file_of("preset.ini", bytes, text.size()), demo, again, read);
  if (flags_of(read, again) == flags) return;
  std::fprintf(stderr, "not the same when it is read again:\n%s", text.c_str());
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::reads_or_refuses(fuzz::file_of("flags.ini", data, size), [](const std::string& path) {
    Settled demo;
    Settings settings;
    demo.declare_settings(settings);
    Options options;
    std::string words[] = {"fuzz_config", "--headless", "--config", path};
    char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), words[3].data()};
    read_command_line(4, arguments, demo, settings, options);
    check_round_trip(options, settings);
  });
}
