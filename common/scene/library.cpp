#include "common/scene/library.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <sstream>

#include "common/error.h"
#include "common/image/files.h"
#include "common/scene/extreme.h"
#include "common/scene/scene_file.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

bool has_assets(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder / "assets" / "newell", error);
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// What is said here of scenes that are fetched; the rest the tables say.

struct Portrait {
  const char* scene;
  const char* what;
  vec3 up, towards_eye;
  float distance;  ///< of the eye from the middle, in diagonals of the bounds
};

constexpr vec3 y_up{0, 1, 0}, z_up{0, 0, 1};

constexpr Portrait portraits[] = {
    {"bunny", "the Stanford bunny", y_up, {-0.42f, 0.3f, 0.86f}, 1.25f},  // its face turned to us
    {"dragon", "the Stanford dragon", y_up, {0.35f, 0.25f, 0.9f}, 1.25f},
    {"dragon_res2", "the same, decimated", y_up, {0.35f, 0.25f, 0.9f}, 1.25f},
    {"dragon_res3", "the same, decimated twice", y_up, {0.35f, 0.25f, 0.9f}, 1.25f},
    {"dragon_res4", "the same, decimated thrice", y_up, {0.35f, 0.25f, 0.9f}, 1.25f},
    {"armadillo", "the Stanford armadillo, coarse", y_up, {0.3f, 0.2f, -0.9f}, 1.3f},
    {"cgal_bunny", "the Stanford bunny, without holes", y_up, {-0.42f, 0.3f, 0.86f}, 1.25f},
    {"elephant", "an elephant on one leg", y_up, {0.5f, 0.3f, 0.86f}, 1.3f},
    {"opensubdiv/catmark_bishop", "a chessman's cage", z_up, {0.5f, -0.86f, 0.36f}, 1.4f},
    {"opensubdiv/catmark_car", "a car's cage", z_up, {0.5f, -0.86f, 0.36f}, 1.4f},
    {"opensubdiv/catmark_pawn", "a chessman's cage", z_up, {0.5f, -0.86f, 0.36f}, 1.4f},
    {"opensubdiv/catmark_rook", "a chessman's cage", z_up, {0.5f, -0.86f, 0.36f}, 1.4f},
};

const Portrait* portrait_of(const std::string& scene) {
  const auto* const found = std::find_if(std::begin(portraits), std::end(portraits),
                                         [&](const Portrait& p) { return scene == p.scene; });
  return found == std::end(portraits) ? nullptr : found;
}

// The tables in assets/library.

/// Lines of fields between '|'; those that begin with # are for people.
template <class Row>
void read_table(const fs::path& path, std::size_t fields, const Row& row) {
  std::istringstream text(read_text(path.string()));
  std::size_t number = 0;
  for (std::string line; std::getline(text, line);) {
    ++number;
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> values(1);
    for (const char c : line) {
      if (c == '|')
        values.emplace_back();
      else
        values.back() += c;
    }
    if (values.size() != fields)
      refuse(path.string(), number,
             std::to_string(values.size()) + " fields; " + std::to_string(fields) + " are wanted");
    row(values, number);
  }
}

struct Asset {
  std::string name, licence, what;
  bool collection;
};

/// The name without what says what kind of model it is; empty where it is no scene.
std::string stem(const std::string& name) {
  for (const std::string_view ending :
       {".obj", ".ply", ".ply.gz", ".off", ".off.gz", ".gltf", ".glb", ".json", ".exr"})
    if (name.size() > ending.size() && name.ends_with(ending))
      return name.substr(0, name.size() - ending.size());
  return "";
}

std::vector<Asset> assets(const fs::path& root) {
  std::vector<Asset> all;
  const fs::path path = root / "assets/library/packages";
  read_table(path, 8, [&](const std::vector<std::string>& v, std::size_t line) {
    if (v[3] != "scenes" && v[3] != "collection")
      refuse(path.string(), line, in_quotes(v[3]) + " is no kind; scenes and collection are");
    all.push_back({v[0], v[6], v[7], v[3] == "collection"});
  });
  return all;
}

/// A scene for every model and sky among the files of an asset.
void add_fetched(const fs::path& root, std::vector<SceneEntry>& entries) {
  const std::vector<Asset> known = assets(root);
  const fs::path path = root / "assets/library/checksums";
  std::istringstream text(read_text(path.string()));
  constexpr std::size_t sum = 64 + 2;  // hexadecimal digits and spaces
  std::size_t number = 0;
  for (std::string line; std::getline(text, line);) {
    ++number;
    const std::size_t slash = line.find('/');
    if (slash <= sum || slash == line.npos)
      refuse(path.string(), number, "no checksum and file; sha256sum writes such lines");
    const std::string file = line.substr(sum), name = stem(file.substr(file.rfind('/') + 1));
    const auto asset = std::find_if(known.begin(), known.end(), [&](const Asset& a) {
      return file.compare(0, slash - sum, a.name) == 0;
    });
    if (asset == known.end()) refuse(path.string(), number, "of no asset that assets/library/packages names");
    if (name.empty()) continue;
    SceneEntry entry;
    entry.name = asset->collection ? asset->name + "/" + name : name;
    entry.kind = SceneEntry::Kind::fetched;
    entry.what = asset->what;
    entry.licence = asset->licence;
    entry.asset = asset->name;
    entry.collection = asset->collection ? asset->name : "";
    if (const Portrait* portrait = portrait_of(entry.name)) entry.what = portrait->what;
    entry.file = root / "assets/cache" / file;
    entry.available = is_file(entry.file);
    entries.push_back(std::move(entry));
  }
}

void add_shipped(const fs::path& root, std::vector<SceneEntry>& entries) {
  std::error_code error;
  const std::size_t first = entries.size();
  for (const auto& file : fs::directory_iterator(root / "assets/scenes", error)) {
    if (file.path().extension() != ".json") continue;
    SceneEntry entry;
    entry.name = file.path().stem().string();
    entry.kind = SceneEntry::Kind::shipped;
    entry.what = "assets/scenes/" + file.path().filename().string();
    entry.licence = "MIT";
    entry.file = file.path();
    entries.push_back(std::move(entry));
  }
  std::sort(entries.begin() + static_cast<std::ptrdiff_t>(first), entries.end(),
            [](const SceneEntry& a, const SceneEntry& b) { return a.name < b.name; });
}

void add_numbers(const fs::path& root, std::vector<SceneEntry>& entries) {
  std::map<std::string, SceneEntry*> named;
  for (SceneEntry& entry : entries) named[entry.name] = &entry;
  const fs::path path = root / "assets/library/scenes";
  read_table(path, 3, [&](const std::vector<std::string>& v, std::size_t line) {
    const auto found = named.find(v[0]);
    if (found == named.end()) return;  // a scene of a later version, or a file that somebody took away
    std::size_t triangles = 0;
    const auto [end, error] = std::from_chars(v[1].data(), v[1].data() + v[1].size(), triangles);
    if (error != std::errc() || end != v[1].data() + v[1].size())
      refuse(path.string(), line, in_quotes(v[1]) + " is no number of triangles; write one");
    found->second->triangles = triangles;
    std::istringstream words(v[2]);
    for (std::string word; words >> word;) found->second->features.push_back(word);
  });
}

// Loading.

/// Three balls on a table, a matte one, a glossy one and a mirror: what there is to see under a sky.
Scene under_sky(const fs::path& file, const LoadOptions& options) {
  Scene scene;
  const auto material = [&](const char* name, const vec3& diffuse) -> Material& {
    Material& m = scene.materials.emplace_back();
    m.name = name;
    m.diffuse = diffuse;
    return m;
  };
  material("table", vec3(0.3f));
  material("matte", vec3(0.6f));
  Material& glossy = material("glossy", {0.9f, 0.6f, 0.3f});
  glossy.metallic = 1;
  glossy.roughness = 0.25f;
  Material& mirror = material("mirror", vec3(0));
  mirror.reflection = vec3(0.95f);
  mirror.roughness = 0;

  Mesh table;
  table.name = "table";
  table.positions = {{-6, 0, -4}, {-6, 0, 6}, {6, 0, 6}, {6, 0, -4}};
  table.normals.assign(4, vec3(0, 1, 0));
  table.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.meshes.push_back(std::move(table));
  for (std::uint32_t i = 1; i <= 3; ++i) {
    const dvec3 centre(2.4 * (double(i) - 2), 1, 0);
    Mesh ball = icosphere(4, 1, centre);
    ball.name = scene.materials[i].name + " ball";
    for (const vec3& p : ball.positions) ball.normals.push_back(glm::normalize(dvec3(p) - centre));
    ball.materials.assign(ball.triangles.size(), i);
    scene.meshes.push_back(std::move(ball));
  }
  scene.environment.colour = vec3(1);
  scene.environment.file = file.filename().string();
  if (options.environment) scene.environment.image = as_light(read_environment(file.string()));
  scene.camera = {{0, 3.8f, 10}, {0, 0.7f, 0}, {0, 1, 0}, 32};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

Scene load_entry(const SceneEntry& entry, LoadOptions options) {
  if (!entry.available)
    throw InputError(entry.name + ": it has not been fetched; run ./trilha assets " + entry.asset);
  if (entry.kind == SceneEntry::Kind::shipped && options.folder.empty())
    options.folder = fs::weakly_canonical(root_folder() / "assets");  // it may name what is fetched
  Scene scene = entry.file.extension() == ".exr"
                    ? under_sky(entry.file, options)
                    : load_model(entry.file.string(), within_folder_of(entry.file.string(), options));
  scene.name = entry.name;
  if (const Portrait* portrait = portrait_of(entry.name)) {
    const Box box = bounds(scene);
    scene.camera = framing(box, portrait->up);
    scene.camera.target = box.centre();
    scene.camera.eye =
        box.centre() + portrait->distance * glm::length(box.size()) * glm::normalize(portrait->towards_eye);
  } else if (!entry.collection.empty() && entry.file.extension() != ".exr") {
    scene.camera =
        framing(bounds(scene), vec3(0, 1, 0));  // things, not rooms: a cupboard is no place to stand in
  }
  return scene;
}

// Names.

/// How many letters have to be put in, taken away or replaced (Levenshtein 1966).
std::size_t edits(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t corner = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j)
      corner = std::exchange(row[j + 1], std::min({corner + (a[i] != b[j]), row[j] + 1, row[j + 1] + 1}));
  }
  return row.back();
}

/// Throws InputError with what there is: scenes that have a similar name, and all but those of collections.
[[noreturn]] void refuse_name(const std::string& name, const std::vector<SceneEntry>& entries,
                              const std::string& wanted) {
  constexpr std::size_t longest = 64;  // names that a typing error can have come from
  const SceneEntry* nearest = nullptr;
  std::size_t fewest = 3;
  for (const SceneEntry& entry : entries)
    if (name.size() <= longest && !name.empty())
      if (const std::size_t n = edits(name, entry.name); n < fewest) {
        nearest = &entry;
        fewest = n;
      }
  std::string text = in_quotes(name) + " is " + wanted + "; ";
  if (nearest != nullptr) text += "near it: " + nearest->name + "; ";
  const std::string folder = name.substr(0, name.find('/'));
  for (const SceneCollection& collection : scene_collections())
    if (folder == collection.name)
      throw InputError(text + "./trilha list scenes " + collection.name + " lists the " +
                       std::to_string(collection.scenes) + " in " + collection.name);
  std::string names;
  for (const SceneEntry& entry : entries)
    if (entry.collection.empty()) names += (names.empty() ? "" : ", ") + entry.name;
  for (const SceneCollection& collection : scene_collections()) names += ", " + collection.name + "/…";
  throw InputError(text + "scenes are " + names +
                   "; files end in .obj, .ply, .ply.gz, .off, .off.gz, .gltf, .glb or .json");
}

/// The entries that a list is asked for: all, a collection's, or one.
std::vector<SceneEntry> chosen(const std::string& name) {
  std::vector<SceneEntry> all = scene_table(), some;
  if (name.empty()) return all;
  const std::string collection = name.ends_with('/') ? name.substr(0, name.size() - 1) : name;
  for (const SceneEntry& entry : all)
    if (entry.name == name || (!entry.collection.empty() && entry.collection == collection))
      some.push_back(entry);
  if (some.empty()) refuse_name(name, all, "neither a scene nor a collection");
  return some;
}

// Listing.

constexpr std::size_t width = 110;

/// How many characters a text shows: bytes that begin one in UTF-8.
std::size_t characters(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string left(const std::string& text, std::size_t columns) {
  return text + std::string(columns - std::min(columns, characters(text)), ' ');
}

std::string right(const std::string& text, std::size_t columns) {
  return std::string(columns - std::min(columns, characters(text)), ' ') + text;
}

/// 871 414.
std::string grouped(std::size_t number) {
  std::string text = std::to_string(number);
  for (std::size_t i = text.size(); i > 3;) text.insert(i -= 3, " ");
  return text;
}

/// The parameter as it is unless said: hall:detail=4, cornell_box:light=panel.
std::string unless_said(const SceneEntry& entry, const Parameter& p) {
  const std::string value = p.words.empty() ? shown(p.value, 15) : p.words[std::size_t(p.value - p.low)];
  return entry.name + ":" + p.name + "=" + value;
}

/// What it may be: a range, or one of some words.
std::string choices(const Parameter& p) {
  if (p.words.empty())
    return shown(p.low, 15) + " to " + shown(p.high, 15) + (p.whole ? "" : ", not only whole numbers");
  std::string text = p.words[0];
  for (std::size_t i = 1; i < p.words.size(); ++i)
    text += (i + 1 == p.words.size() ? " or " : ", ") + p.words[i];
  return text;
}

std::string triangles_or(const SceneEntry& entry, const char* otherwise) {
  return entry.triangles ? grouped(*entry.triangles) : otherwise;
}

/// The words in lines of so many characters; a word that is longer has a line of its own.
std::vector<std::string> wrapped(const std::string& text, std::size_t columns) {
  std::vector<std::string> lines;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (lines.empty() || characters(lines.back()) + 1 + characters(word) > columns)
      lines.push_back(word);
    else
      lines.back() += " " + word;
  }
  return lines;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Prints the lines in a column that begins after `before` characters, the first after `head`.
void print_column(std::ostream& out, const std::string& head, std::size_t before,
                  const std::vector<std::string>& lines) {
  out << head;
  for (std::size_t i = 0; i < lines.size(); ++i)
    out << (i == 0 ? "" : "\n" + std::string(before, ' ')) << lines[i];
  out << "\n";
}

/// One a line and what it is; its features in the lines below.
void print_table(std::ostream& out, const std::vector<SceneEntry>& entries, bool say_what) {
  std::size_t names = 4, licences = 7;
  for (const SceneEntry& entry : entries) {
    names = std::max(names, characters(entry.name));
    licences = std::max(licences, characters(entry.licence));
  }
  const auto head = [&](const std::string& name, const std::string& triangles, const std::string& here,
                        const std::string& licence) {
    return left(name, names) + right(triangles, 11) + "  " + left(here, 6) + left(licence, licences + 2);
  };
  const std::size_t before = names + 11 + 2 + 6 + licences + 2;
  out << head("name", "triangles", "here", "licence") << (say_what ? "what, and its features" : "features")
      << "\n";
  for (const SceneEntry& entry : entries) {
    std::vector<std::string> lines;
    if (say_what) lines = wrapped(entry.what, width - before);
    for (std::string& line : wrapped(joined(entry.features), width - before))
      lines.push_back(std::move(line));
    print_column(out,
                 head(entry.name, triangles_or(entry, "?"), entry.available ? "yes" : "no", entry.licence),
                 before, lines);
  }
}

void print_parameters(std::ostream& out, const SceneEntry& entry, std::size_t names) {
  for (const Parameter& p : entry.parameters)
    print_column(out, left(unless_said(entry, p), names + 2), names + 2,
                 wrapped(std::string(p.help) + "; " + choices(p), width - names - 2));
}

void print_one(std::ostream& out, const SceneEntry& entry) {
  const auto line = [&](const char* what, const std::string& text) {
    print_column(out, left(what, 12), 12, wrapped(text, width - 12));
  };
  line("scene", entry.name + ": " + entry.what);
  line("triangles", triangles_or(entry, "not known before it is loaded"));
  if (entry.triangles) line("features", entry.features.empty() ? "none" : joined(entry.features));
  line("licence", entry.licence);
  line("here", entry.available ? "yes" : "no: ./trilha assets " + entry.asset + " fetches it");
  if (!entry.file.empty()) line("file", entry.file.string());
  if (entry.parameters.empty()) return;
  out << "\n";
  std::size_t names = 0;
  for (const Parameter& p : entry.parameters) names = std::max(names, characters(unless_said(entry, p)));
  print_parameters(out, entry, names);
}

const char* name_of(SceneEntry::Kind kind) {
  switch (kind) {
    case SceneEntry::Kind::made:
      return "made";
    case SceneEntry::Kind::shipped:
      return "shipped";
    default:
      return "fetched";
  }
}

}  // namespace

fs::path root_folder() {
  if (const char* root = std::getenv("TRILHA_ROOT"); root != nullptr && *root != '\0') {
    if (has_assets(root)) return root;
    throw InputError("TRILHA_ROOT=" + in_quotes(root) +
                     " has no assets/newell; name Trilha's own folder, or unset it");
  }
  std::error_code error;
  for (fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path(); !folder.empty();
       folder = folder.parent_path()) {
    if (has_assets(folder)) return folder;
    if (folder == folder.root_path()) break;
  }
#ifdef TRILHA_SOURCE_DIR
  if (has_assets(TRILHA_SOURCE_DIR)) return TRILHA_SOURCE_DIR;
#endif
  throw InputError("Trilha's folder, with assets/newell, was not found; set TRILHA_ROOT to it");
}

std::vector<SceneEntry> scene_table() {
  const fs::path root = root_folder();
  std::vector<SceneEntry> entries;
  for (const MadeScene& made : made_scenes()) {
    SceneEntry entry;
    entry.name = made.name;
    entry.what = made.what;
    entry.licence = "MIT";
    entry.parameters = made.parameters;
    entries.push_back(std::move(entry));
  }
  add_shipped(root, entries);
  add_fetched(root, entries);
  add_numbers(root, entries);
  return entries;
}

std::vector<SceneCollection> scene_collections() {
  std::vector<SceneCollection> collections;
  for (const Asset& asset : assets(root_folder()))
    if (asset.collection) collections.push_back({asset.name, asset.what, asset.licence, 0, 0});
  for (const SceneEntry& entry : scene_table())
    for (SceneCollection& collection : collections)
      if (entry.collection == collection.name) {
        ++collection.scenes;
        collection.available += entry.available;
      }
  return collections;
}

void print_scenes(std::ostream& out, const std::string& name) {
  std::vector<SceneEntry> entries = chosen(name);
  if (entries.size() == 1 && entries[0].name == name) return print_one(out, entries[0]);
  if (!name.empty()) return print_table(out, entries, false);

  entries.erase(std::remove_if(entries.begin(), entries.end(),
                               [](const SceneEntry& entry) { return !entry.collection.empty(); }),
                entries.end());
  print_table(out, entries, true);

  const std::vector<SceneCollection> collections = scene_collections();
  std::size_t names = 0, licences = 0;
  for (const SceneCollection& c : collections) {
    names = std::max(names, characters(c.name) + 2);
    licences = std::max(licences, characters(c.licence));
  }
  out << "\ncollections: ./trilha list scenes NAME\n";
  for (const SceneCollection& c : collections) {
    const std::string head = left(c.name + "/…", names) + right(grouped(c.scenes), 6) + " scenes, " +
                             left(c.available == c.scenes ? "here"
                                  : c.available == 0      ? "not here"
                                                          : grouped(c.available) + " here",
                                  10) +
                             left(c.licence, licences + 2);
    print_column(out, head, characters(head), wrapped(c.what, width - characters(head)));
  }

  names = 0;
  for (const SceneEntry& entry : entries)
    for (const Parameter& p : entry.parameters) names = std::max(names, characters(unless_said(entry, p)));
  if (names > 0) out << "\nparameters, as they are unless said; several: NAME:a=1,b=2\n";
  for (const SceneEntry& entry : entries) print_parameters(out, entry, names);
  out << "\nto fetch what is not here: ./trilha assets\n";
}

std::string scenes_as_json(const std::string& name) {
  using Json = nlohmann::ordered_json;
  Json scenes = Json::array(), collections = Json::array();
  for (const SceneEntry& entry : chosen(name)) {
    Json parameters = Json::array();
    for (const Parameter& p : entry.parameters)
      parameters.push_back({{"name", p.name},
                            {"help", p.help},
                            {"value", p.value},
                            {"low", p.low},
                            {"high", p.high},
                            {"whole", p.whole},
                            {"words", p.words}});
    const auto or_null = [](const std::string& text) { return text.empty() ? Json() : Json(text); };
    scenes.push_back({{"name", entry.name},
                      {"kind", name_of(entry.kind)},
                      {"what", entry.what},
                      {"triangles", entry.triangles ? Json(*entry.triangles) : Json()},
                      {"features", entry.triangles ? Json(entry.features) : Json()},
                      {"licence", entry.licence},
                      {"here", entry.available},
                      {"asset", or_null(entry.asset)},
                      {"collection", or_null(entry.collection)},
                      {"file", or_null(entry.file.string())},
                      {"parameters", parameters}});
  }
  for (const SceneCollection& c : scene_collections())
    if (name.empty() || name == c.name)
      collections.push_back({{"name", c.name},
                             {"what", c.what},
                             {"licence", c.licence},
                             {"scenes", c.scenes},
                             {"here", c.available}});
  return Json{{"scenes", scenes}, {"collections", collections}}.dump(2, ' ', false,
                                                                     Json::error_handler_t::replace) +
         "\n";
}

Scene load_scene(const std::string& name_or_file, const LoadOptions& options) {
  const std::size_t colon = name_or_file.find(':');
  const std::string name = name_or_file.substr(0, colon);
  const std::string_view parameters =
      colon == std::string::npos ? "" : std::string_view(name_or_file).substr(colon + 1);
  for (const MadeScene& made : made_scenes())
    if (name == made.name) {
      Scene scene = made.make(Parameters(name, made.parameters, parameters, options));
      scene.name = name_or_file;
      return scene;
    }
  // Scenes' names have no ending: files are read without the library, wherever the program is.
  if (fs::path(name_or_file).has_extension())
    return load_model(name_or_file, within_folder_of(name_or_file, options));

  const std::vector<SceneEntry> entries = scene_table();
  const auto entry = std::find_if(entries.begin(), entries.end(), [&](const SceneEntry& e) {
    return e.name == (name_or_file.empty() ? "bunny" : name);
  });
  if (name_or_file.empty()) {
    if (entry != entries.end() && entry->available) return load_entry(*entry, options);
    Scene scene = load_scene("teaset", options);
    scene.warnings.push_back(
        "the bunny has not been fetched (./trilha assets bunny): showing the shipped tea set");
    return scene;
  }
  if (entry != entries.end()) {
    Parameters(name, {}, parameters);  // says that it has none
    return load_entry(*entry, options);
  }
  std::error_code error;
  if (fs::exists(name_or_file, error))
    return load_model(name_or_file, within_folder_of(name_or_file, options));
  refuse_name(name_or_file, entries, "neither a scene nor a file");
}

}  // namespace trilha
