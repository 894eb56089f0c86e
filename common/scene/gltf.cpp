// The JSON is read by ourselves. tinygltf 2.7 was tried: on files that mean harm it reads beyond its buffers
// (a BIN chunk eight bytes too long, an image beyond its buffer), overflows the stack on nested extras, holds
// a buffer file once for each mention, and makes 2³² a 0 without a word. What would be left to it after a
// strict pass is copying.

#include "common/scene/gltf.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>

#include "common/error.h"
#include "common/scene/json.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF's numbers are read as they lie in the file");

namespace fs = std::filesystem;

constexpr double largest = std::numeric_limits<float>::max();
constexpr std::int64_t most_elements = 4294967294;          // what 32 bits number
constexpr std::int64_t most_bytes = std::int64_t{1} << 53;  // up to there a double is a whole number

// What the bytes of the buffers may become, in triangles and vertices. Honest files have less than two a
// byte: a strip of bytes has one triangle, a vertex is three at least. What is shared brings more out of the
// same bytes, such as a cube in a thousand colours: so each primitive brings a few of its own, and so does
// the file.
constexpr std::size_t most_per_byte = 2;
constexpr std::size_t free_per_primitive = 64;
constexpr std::size_t free_per_file = std::size_t{1} << 16;
constexpr std::size_t most_free = std::size_t{1} << 20;
constexpr std::size_t most_zeros = std::size_t{1} << 20;  // elements that no buffer holds
constexpr std::size_t most_instances = std::size_t{1} << 22;

// The file, and the objects in it.

/// The lists of the file; lights are those of an extension.
enum class List : std::uint8_t {
  accessors,
  buffers,
  buffer_views,
  cameras,
  images,
  materials,
  meshes,
  nodes,
  samplers,
  scenes,
  textures,
  lights
};

struct ListName {
  const char *key, *one;
};
constexpr std::array<ListName, 12> list_names = {{{"accessors", "accessor"},
                                                  {"buffers", "buffer"},
                                                  {"bufferViews", "buffer view"},
                                                  {"cameras", "camera"},
                                                  {"images", "image"},
                                                  {"materials", "material"},
                                                  {"meshes", "mesh"},
                                                  {"nodes", "node"},
                                                  {"samplers", "sampler"},
                                                  {"scenes", "scene"},
                                                  {"textures", "texture"},
                                                  {"lights", "light"}}};

const ListName& name_of(List list) { return list_names[static_cast<std::size_t>(list)]; }

/// An object of the file, with what it is called.
class Item {
 public:
  Item(const std::string& path, const Json& object, std::string called)
      : what(std::move(called)), json(object), path_(path), members_(path, object, what.c_str(), {}) {
    // Keys are looked for one by one, in an object that many others may name.
    constexpr std::size_t most_keys = 256;
    if (object.members().size() > most_keys)
      refuse("has " + std::to_string(object.members().size()) + " keys; glTF has use for a few, " +
             std::to_string(most_keys) + " are the most");
  }
  Item(const Item&) = delete;
  Item& operator=(const Item&) = delete;

  const std::string what;  // "mesh 3 'arm'"
  const Json& json;

  const Members* operator->() const { return &members_; }
  const std::string& path() const { return path_; }

  /// The object of that key; one without members where there is none.
  Item part(const char* key) const {
    static const Json nothing = [] {
      Json json;
      json.kind = Json::Kind::object;
      return json;
    }();
    const Json* found = json.find(key);
    return {path_, found != nullptr ? *found : nothing, std::string(key) + " of " + what};
  }
  Item extension(const char* name) const { return part("extensions").part(name); }
  bool has_extension(const char* name) const {
    return json.find("extensions") != nullptr && part("extensions")->has(name);
  }

  /// A number from 0 to 1. Exporters round, some of them upwards.
  double fraction(const char* key, double otherwise) const {
    return std::min(1.0, members_.number(key, otherwise, 0, 1.001));
  }

  [[noreturn]] void refuse(const std::string& why) const {
    trilha::refuse(path_, json.line, what + " " + why);
  }

 private:
  const std::string& path_;
  Members members_;
};

/// The bytes that base64 stands for (RFC 4648), its padding wanted or not; none where it is no base64.
std::optional<std::string> base64_decoded(std::string_view text) {
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  static const std::array<std::int8_t, 256> values = [&] {
    std::array<std::int8_t, 256> table;
    table.fill(-1);
    for (std::size_t i = 0; i < digits.size(); ++i)
      table[static_cast<unsigned char>(digits[i])] = static_cast<std::int8_t>(i);
    return table;
  }();
  if (text.size() % 4 == 0) text.remove_suffix(text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0);
  if (text.size() % 4 == 1) return std::nullopt;
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int filled = 0;
  for (const char c : text) {
    const int value = values[static_cast<unsigned char>(c)];
    if (value < 0) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    filled += 6;
    if (filled >= 8) {
      filled -= 8;
      bytes += static_cast<char>(bits >> filled & 0xff);
    }
  }
  return bytes;
}

/// The name without its %20s.
std::string percent_decoded(const std::string& text) {
  const auto digit = [&](std::size_t i) {
    const char c = i < text.size() ? text[i] : ' ';
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && digit(i + 1) >= 0 && digit(i + 2) >= 0) {
      result += static_cast<char>(16 * digit(i + 1) + digit(i + 2));
      i += 2;
    } else {
      result += text[i];
    }
  }
  return result;
}

/// A part of a buffer.
struct BufferView {
  std::string_view bytes;
  std::size_t stride = 0;  // 0: elements follow each other
};

class File {
 public:
  File(const std::string& path, const LoadOptions& options)
      : path(path),
        options(options),
        bytes_(read_bytes(path)),
        json_(parse()),
        root(path, json_, "the file") {
    check_version();
    for (std::size_t i = 0; i + 1 < lists_.size(); ++i) lists_[i] = &root->list(list_names[i].key);
    lists_.back() = &root.extension("KHR_lights_punctual")->list("lights");
    buffers_.resize(list(List::buffers).size());
    buffer_views_.resize(list(List::buffer_views).size());
  }

  const std::string& path;
  const LoadOptions& options;

  const std::vector<Json>& list(List which) const { return *lists_[static_cast<std::size_t>(which)]; }

  Item item(List which, std::size_t number) const {
    const Json& json = list(which)[number];
    std::string called = name_of(which).one + (" " + std::to_string(number));
    const Json* name = json.find("name");
    if (name != nullptr && !name->text().empty()) called += " " + in_quotes(name->text());
    return {path, json, std::move(called)};
  }

  /// The value, of that key of the object, as a number in that list.
  std::size_t index(const Item& of, const char* key, const Json& value, List which) const {
    const std::size_t size = list(which).size();
    if (value.kind == Json::Kind::number && value.number >= 0 && value.number < double(size) &&
        value.number == std::floor(value.number))
      return static_cast<std::size_t>(value.number);
    std::ostringstream text;
    text << in_quotes(key) << " of " << of.what << " is ";
    if (value.kind == Json::Kind::number) {
      text << value.number;
    } else {
      text << kind_name(value.kind);
    }
    const char* const names = name_of(which).key;
    if (size == 0) {
      text << "; the file has no " << names;
    } else {
      text << "; its " << names << " have the numbers 0 to " << size - 1;
    }
    refuse(path, value.line, text.str());
  }
  std::size_t index(const Item& of, const char* key, List which) const {
    return index(of, key, of->need(key), which);
  }

  /// The bytes of a data URI; none where the URI names a file.
  std::optional<std::string> data(const Item& of) const {
    const std::string uri = of->text("uri", "");
    if (!uri.starts_with("data:")) return std::nullopt;
    const std::size_t comma = uri.find(',');
    if (comma == uri.npos || !std::string_view(uri).substr(0, comma).ends_with(";base64"))
      of->refuse_key("uri", "is a data URI without \";base64,\"; only base64 is read");
    std::optional<std::string> bytes = base64_decoded(std::string_view(uri).substr(comma + 1));
    if (!bytes) of->refuse_key("uri", "has what is no base64 (A-Z, a-z, 0-9, + and /); encode it again");
    return bytes;
  }

  /// The file that the URI names.
  fs::path named(const Item& of) const {
    const std::string uri = of->text("uri", "");
    if (uri.find("://") != uri.npos)
      of->refuse_key("uri", "is " + in_quotes(uri) + "; only files beside the scene are read, fetch it");
    return named_file(percent_decoded(uri), path, of->need("uri").line, options);
  }

  const BufferView& buffer_view(std::size_t number) {
    std::optional<BufferView>& known = buffer_views_[number];
    if (!known) {
      const Item view = item(List::buffer_views, number);
      const std::string_view bytes = buffer(index(view, "buffer", List::buffers));
      const std::size_t offset = whole(view, "byteOffset", 0, most_bytes, 0);
      const std::size_t length = whole(view, "byteLength", 1, most_bytes);
      if (offset + length > bytes.size())
        view.refuse("ends at byte " + std::to_string(offset + length) + " of a buffer of " +
                    std::to_string(bytes.size()) + "; make it shorter, or check its byteOffset");
      known = {bytes.substr(offset, length), whole(view, "byteStride", 4, 252, 0)};
    }
    return *known;
  }

  /// A whole number; needed, where nothing stands for it.
  static std::size_t whole(const Item& of, const char* key, std::int64_t low, std::int64_t high,
                           std::optional<std::int64_t> otherwise = std::nullopt) {
    if (!otherwise) of->need(key);
    return static_cast<std::size_t>(of->whole(key, otherwise.value_or(low), low, high));
  }

  /// To be called before so many triangles, vertices or instances (as four) are made out of buffers, or
  /// elements looked at. A file whose objects share their bytes could ask for any number of them.
  void charge(std::size_t elements, const Item& by) {
    charged_ += elements;
    if (charged_ > most_per_byte * buffer_bytes_ + free_)
      by.refuse("brings what the file makes of " + counted(buffer_bytes_, "byte") + " of buffers to " +
                std::to_string(charged_) + " triangles and vertices (an instance counts as four); " +
                std::to_string(most_per_byte) + " a byte and " + std::to_string(free_) +
                " besides are the most");
  }
  void charge_primitive() { free_ = std::min(free_ + free_per_primitive, most_free); }

  /// To be called before elements of zeros are made, which take no bytes of the file.
  void charge_zeros(std::size_t elements, const Item& by) {
    zeros_ += elements;
    if (zeros_ > most_zeros)
      by.refuse("brings elements without a buffer view, which are zeros, to " + std::to_string(zeros_) +
                "; " + std::to_string(most_zeros) + " are the most in a file");
  }

  /// To be called before so many instances are made.
  void charge_instances(std::size_t count, const Item& by) {
    instances_ += count;
    if (instances_ > most_instances)
      by.refuse("brings the instances to " + std::to_string(instances_) + "; " +
                std::to_string(most_instances) + " are the most in a file");
  }

 private:
  Json parse() {
    if (bytes_.empty()) refuse(path, 0, "is empty; a glTF file is JSON, or begins with \"glTF\"");
    if (bytes_.starts_with("glTF")) return parse_json(path, json_chunk());
    Json json = parse_json(path, bytes_);
    std::string().swap(bytes_);
    return json;
  }

  // The first chunk of a .glb; the second, if there is one, becomes `binary_`.
  std::string_view json_chunk() {
    const auto word = [&](std::size_t at) {
      std::uint32_t word;
      std::memcpy(&word, bytes_.data() + at, sizeof word);
      return word;
    };
    constexpr std::size_t header = 12, chunk_header = 8;
    constexpr std::uint32_t json = 0x4e4f534a, binary = 0x004e4942;
    if (bytes_.size() < header + chunk_header)
      refuse(path, 0, "ends after " + counted(bytes_.size(), "byte") + "; a .glb has 20 before its JSON");
    if (word(4) != 2)
      refuse(path, 0, "is a .glb of version " + std::to_string(word(4)) + "; version 2 is read");
    if (word(8) != bytes_.size())
      refuse(path, 0,
             "says that it has " + counted(word(8), "byte") + " and has " + std::to_string(bytes_.size()) +
                 "; fetch it again");
    std::string_view text;
    int chunk = 0;
    for (std::size_t at = header; at < bytes_.size(); ++chunk) {
      if (bytes_.size() - at < chunk_header || bytes_.size() - at - chunk_header < word(at))
        refuse(path, 0,
               "chunk " + std::to_string(chunk) + " of the .glb reaches beyond the file; fetch it again");
      const std::string_view contents = std::string_view(bytes_).substr(at + chunk_header, word(at));
      const std::uint32_t kind = word(at + 4);
      if (chunk == 0) {
        if (kind != json) refuse(path, 0, "the first chunk of the .glb is not JSON; it has to be");
        text = contents;
      } else if (chunk == 1 && kind == binary) {
        binary_ = contents;
        buffer_bytes_ += contents.size();
      }
      at += chunk_header + contents.size();
    }
    return text;
  }

  void check_version() const {
    root->need("asset");
    const Item asset = root.part("asset");
    asset->need("version");
    for (const char* key : {"version", "minVersion"}) {
      const std::string version = asset->text(key, "2.0");
      if (!version.starts_with("2.") || (key[0] == 'm' && version != "2.0"))
        asset->refuse_key(key, "is " + in_quotes(version) + "; glTF 2.0 is read");
    }
  }

  std::string_view buffer(std::size_t number) {
    std::optional<std::string_view>& known = buffers_[number];
    if (known) return *known;
    const Item buffer = item(List::buffers, number);
    const std::size_t length = whole(buffer, "byteLength", 1, most_bytes);
    std::string_view bytes = binary_;
    if (!buffer->has("uri")) {
      if (number != 0 || binary_.empty())
        buffer.refuse("has no bytes; name its file as 'uri', or save it uncompressed");
    } else if (std::optional<std::string> data = this->data(buffer)) {
      bytes = data_.emplace_back(std::make_unique<std::string>(std::move(*data))).operator*();
      buffer_bytes_ += bytes.size();
    } else {
      // Once, however often and by which ways it is named.
      const fs::path file = named(buffer);
      std::error_code error;
      const auto [found, is_new] = files_.try_emplace(fs::weakly_canonical(file, error).string());
      if (is_new) {
        try {
          found->second = read_bytes(file.string());
        } catch (const InputError& error) {  // which names that file alone
          buffer->refuse_key("uri", std::string("names what is not there to read: ") + error.what());
        }
        buffer_bytes_ += found->second.size();
      }
      bytes = found->second;
    }
    if (bytes.size() < length)
      buffer->refuse_key("byteLength", "is " + std::to_string(length) + "; there are " +
                                           counted(bytes.size(), "byte") + ", is the file cut short?");
    known = bytes.substr(0, length);
    return *known;
  }

  std::string bytes_;             // of a .glb
  std::string_view binary_;       // in them
  std::size_t buffer_bytes_ = 0;  // that are there, of buffers that were read so far
  std::size_t charged_ = 0, free_ = free_per_file, zeros_ = 0, instances_ = 0;
  Json json_;
  std::array<const std::vector<Json>*, list_names.size()> lists_{};
  std::vector<std::optional<std::string_view>> buffers_;
  std::vector<std::optional<BufferView>> buffer_views_;
  std::map<std::string, std::string> files_;
  std::vector<std::unique_ptr<std::string>> data_;

 public:
  const Item root;
};

// Accessors.

struct Format {
  int type;
  bool normalized;

  bool operator==(const Format&) const = default;
};
constexpr int signed_byte = 5120, unsigned_byte = 5121, signed_short = 5122, unsigned_short = 5123,
              unsigned_int = 5125, floating = 5126;

std::size_t size_of(int type) {
  return type == signed_byte || type == unsigned_byte ? 1 : type == unsigned_int || type == floating ? 4 : 2;
}

template <class T>
double read_as(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof value);  // which may lie unaligned
  return static_cast<double>(value);
}

double component(const char* at, const Format& format) {
  const double scale = format.normalized ? 1 : 0;
  const auto scaled = [&](double value, double one) {
    return scale == 0 ? value : std::max(value / one, -1.0);
  };
  switch (format.type) {
    case signed_byte:
      return scaled(read_as<std::int8_t>(at), 127);
    case unsigned_byte:
      return scaled(read_as<std::uint8_t>(at), 255);
    case signed_short:
      return scaled(read_as<std::int16_t>(at), 32767);
    case unsigned_short:
      return scaled(read_as<std::uint16_t>(at), 65535);
    case unsigned_int:
      return read_as<std::uint32_t>(at);
    default:
      return read_as<float>(at);
  }
}

/// Elements that lie in a file as it says.
struct Elements {
  const char* data = nullptr;  // none: zeros
  std::size_t stride = 0;
  Format format{floating, false};

  const char* at(std::size_t i) const { return data + i * stride; }
};

/// A list of numbers or vectors, all of which lie within their buffers.
struct Accessor {
  std::string what;
  std::uint32_t line = 0;
  std::size_t count = 0;
  int components = 1;
  Elements elements;
  std::size_t replaced = 0;  // by sparse ones
  Elements indices, values;

  Vec4<double> operator[](std::size_t i) const {
    const char* at = elements.data == nullptr ? nullptr : elements.at(i);
    if (replaced > 0) {
      const std::size_t place = first_replaced_from(i);
      if (place < replaced && index(place) == i) at = values.at(place);
    }
    Vec4<double> result(0);
    const std::size_t size = size_of(elements.format.type);
    for (int c = 0; c < components && at != nullptr; ++c)
      result[c] = component(at + static_cast<std::size_t>(c) * size, elements.format);
    return result;
  }

  std::size_t index(std::size_t place) const {
    return static_cast<std::size_t>(component(indices.at(place), indices.format));
  }

 private:
  std::size_t first_replaced_from(std::size_t i) const {
    std::size_t low = 0, high = replaced;
    while (low < high) {
      const std::size_t middle = low + (high - low) / 2;
      index(middle) < i ? low = middle + 1 : high = middle;
    }
    return low;
  }
};

/// What elements of one use may be.
struct Wanted {
  const char* what;  // for people
  int components;
  std::vector<Format> formats;
};

const Wanted wanted_indices{"SCALARs of unsigned integers",
                            1,
                            {{unsigned_byte, false}, {unsigned_short, false}, {unsigned_int, false}}};
const Wanted wanted_positions{"VEC3s of floats", 3, {{floating, false}}};
const Wanted wanted_normals = wanted_positions;
const Wanted wanted_coordinates{"VEC2s of floats or normalized unsigned bytes or shorts",
                                2,
                                {{floating, false}, {unsigned_byte, true}, {unsigned_short, true}}};
const Wanted wanted_rotations{"VEC4s of floats or normalized bytes or shorts",
                              4,
                              {{floating, false}, {signed_byte, true}, {signed_short, true}}};
// KHR_mesh_quantization
const std::vector<Format> quantized = {
    {floating, false},      {signed_byte, false},    {signed_byte, true},
    {unsigned_byte, false}, {unsigned_byte, true},   {signed_short, false},
    {signed_short, true},   {unsigned_short, false}, {unsigned_short, true}};
const Wanted quantized_positions{"VEC3s of floats, bytes or shorts", 3, quantized};
const Wanted quantized_normals{"VEC3s of floats or normalized bytes or shorts", 3, wanted_rotations.formats};
const Wanted quantized_coordinates{"VEC2s of floats, bytes or shorts", 2, quantized};

class Accessors {
 public:
  explicit Accessors(File& file) : file_(file), known_(file.list(List::accessors).size()) {}

  /// The accessor whose number the object's key holds.
  const Accessor& get(const Item& of, const char* key, const Wanted& wanted) {
    const std::size_t number = file_.index(of, key, List::accessors);
    std::unique_ptr<Accessor>& known = known_[number];
    if (!known) known = std::make_unique<Accessor>(read(file_.item(List::accessors, number)));
    const auto& formats = wanted.formats;
    if (known->components != wanted.components ||
        std::find(formats.begin(), formats.end(), known->elements.format) == formats.end())
      refuse(file_.path, known->line,
             known->what + " has another type than " + key + " of " + of.what + "; it takes " + wanted.what);
    return *known;
  }

 private:
  static Format format(const Item& of) {
    of->need("componentType");
    const auto type = static_cast<int>(of->whole("componentType", 0, signed_byte, floating));
    if (type == 5124) of->refuse_key("componentType", "is 5124; glTF has 5120 to 5123, 5125 and 5126");
    return {type, type < unsigned_int && of->flag("normalized", false)};
  }

  Elements place(const Item& of, std::size_t count, int components, const Format& format) {
    const BufferView& view = file_.buffer_view(file_.index(of, "bufferView", List::buffer_views));
    const std::size_t size = size_of(format.type) * static_cast<std::size_t>(components);
    const std::size_t offset = File::whole(of, "byteOffset", 0, most_bytes, 0);
    const std::size_t stride = view.stride == 0 ? size : view.stride;
    if (stride < size)
      of.refuse("has elements of " + std::to_string(size) + " bytes in a buffer view with a byteStride of " +
                std::to_string(stride) + "; they would overlap");
    const std::size_t end = offset + stride * (count - 1) + size;  // < 2⁵³ + 2⁸·2³² + 2⁸
    if (end > view.bytes.size())
      of.refuse("ends at byte " + std::to_string(end) + " of a buffer view of " +
                std::to_string(view.bytes.size()) + "; check its count and byteOffset");
    return {view.bytes.data() + offset, stride, format};
  }

  Accessor read(const Item& item) {
    Accessor accessor;
    accessor.what = item.what;
    accessor.line = item.json.line;
    accessor.elements.format = format(item);
    item->need("type");
    const std::string type = item->text("type", "");
    constexpr std::array<const char*, 7> types = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
    const auto found = std::find(types.begin(), types.end(), type);
    if (found == types.end())
      item->refuse_key("type", "is " + in_quotes(type) + "; SCALAR, VEC2, VEC3, VEC4 and MAT2 to MAT4 are");
    accessor.components = static_cast<int>(found - types.begin()) + 1;
    if (accessor.components > 4)
      item->refuse_key("type", "is " + type + "; nothing that is read has matrices");
    accessor.count = File::whole(item, "count", 1, most_elements);
    if (item->has("bufferView"))
      accessor.elements = place(item, accessor.count, accessor.components, accessor.elements.format);
    else
      file_.charge_zeros(accessor.count, item);
    if (item->has("sparse")) read_sparse(item.part("sparse"), accessor);
    return accessor;
  }

  void read_sparse(const Item& sparse, Accessor& accessor) {
    accessor.replaced = File::whole(sparse, "count", 1, static_cast<std::int64_t>(accessor.count));
    file_.charge(accessor.replaced, sparse);
    sparse->need("indices");
    sparse->need("values");
    const Item indices = sparse.part("indices");
    const Format type = format(indices);
    const auto& formats = wanted_indices.formats;
    if (std::find(formats.begin(), formats.end(), type) == formats.end())
      indices->refuse_key("componentType",
                          std::string("is none of indices; it takes ") + wanted_indices.what);
    accessor.indices = place(indices, accessor.replaced, 1, type);
    accessor.values =
        place(sparse.part("values"), accessor.replaced, accessor.components, accessor.elements.format);
    for (std::size_t i = 0; i < accessor.replaced; ++i) {
      if (accessor.index(i) >= accessor.count)
        indices.refuse("name element " + std::to_string(accessor.index(i)) + "; there are " +
                       std::to_string(accessor.count));
      if (i > 0 && accessor.index(i) <= accessor.index(i - 1))
        indices.refuse("do not grow from one to the next; sort them");
    }
  }

  File& file_;
  std::vector<std::unique_ptr<Accessor>> known_;
};

// Materials.

class Materials {
 public:
  Materials(File& file, Scene& scene)
      : file_(file), scene_(scene), set_(scene, file.options), known_(file.list(List::textures).size()) {}

  /// The number in Scene::materials of the one that the primitive names; glTF's own where it names none.
  std::uint32_t number(const Item& primitive) {
    const std::int64_t given =
        primitive->has("material")
            ? static_cast<std::int64_t>(file_.index(primitive, "material", List::materials))
            : -1;
    const auto [found, is_new] =
        numbers_.try_emplace(given, static_cast<std::uint32_t>(scene_.materials.size()));
    if (is_new) {
      Material material;
      if (given >= 0) {
        material = read(file_.item(List::materials, static_cast<std::size_t>(given)));
      } else {
        material.name = "default";
        material.diffuse = vec3(1);
        material.metallic = 1;
      }
      scene_.materials.push_back(std::move(material));
    }
    return found->second;
  }

  void warn(std::vector<std::string>& warnings) const {
    const auto say = [&](std::size_t n, const std::string& what, const std::string& done) {
      if (n > 0) warnings.push_back(file_.path + ": " + counted(n, what) + " " + done);
    };
    say(other_coordinates_, "texture", "with other texture coordinates than TEXCOORD_0 left out");
    say(turned_, "rotated texture", "not rotated");
    say(without_image_, "texture", "without a PNG or JPEG image left out");
    say(infinite_indices_, "infinite refraction index", "set to 1.5");
  }

 private:
  struct Texture {
    std::int64_t image = -1;  // none that is read
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  };

  Material read(const Item& item) {
    Material made;
    made.name = printable(item->text("name", ""));
    if (made.name.empty()) made.name = printable(item.what);

    const Item pbr = item.part("pbrMetallicRoughness");
    Vec4<double> base(1);
    if (const Json* factor = pbr->find("baseColorFactor")) {
      const std::vector<double> four = numbers(file_.path, *factor, "baseColorFactor", 4, 0, 1.001);
      for (int i = 0; i < 4; ++i) base[i] = std::min(1.0, four[static_cast<std::size_t>(i)]);
    }
    made.metallic = static_cast<float>(pbr.fraction("metallicFactor", 1));
    made.roughness = static_cast<float>(pbr.fraction("roughnessFactor", 1));
    made.diffuse_map = map(pbr, "baseColorTexture", TextureUse::colour, 0);
    if (made.metallic > 0) made.metallic_map = map(pbr, "metallicRoughnessTexture", TextureUse::data, 2);
    if (made.roughness > 0) made.roughness_map = map(pbr, "metallicRoughnessTexture", TextureUse::data, 1);

    const double transmitted =
        item.extension("KHR_materials_transmission").fraction("transmissionFactor", 0) *
        (1 - double(made.metallic));
    made.diffuse = vec3((1 - transmitted) * dvec3(base));
    made.transmission = vec3(transmitted * dvec3(base));
    read_inside(item, made);

    const double strength =
        item.extension("KHR_materials_emissive_strength")->number("emissiveStrength", 1, 0, largest);
    made.emission =
        finite(item, "emissiveFactor", strength * item->vector("emissiveFactor", dvec3(0), 0, largest));
    if (made.emission != vec3(0)) made.emission_map = map(item, "emissiveTexture", TextureUse::colour, 0);

    made.normal_map = map(item, "normalTexture", TextureUse::data, 0);
    made.bump_scale = static_cast<float>(item.part("normalTexture")->number("scale", 1, -largest, largest));
    if (made.bump_scale == 0) made.normal_map = {};

    read_alpha(item, base.w, made);
    return made;
  }

  void read_inside(const Item& item, Material& made) {
    const double index = item.extension("KHR_materials_ior")->number("ior", 1.5, 0, 1000);
    if (index != 0 && index < 1)
      item.extension("KHR_materials_ior")->refuse_key("ior", "is below 1; that of the vacuum is 1");
    infinite_indices_ += index == 0;
    made.refraction_index = index == 0 ? 1.5f : static_cast<float>(index);

    const Item volume = item.extension("KHR_materials_volume");
    if (!volume->has("attenuationDistance") || volume->number("thicknessFactor", 0, 0, largest) == 0) return;
    const double distance = volume->number("attenuationDistance", 1, 0, largest);
    const dvec3 colour = volume->vector("attenuationColor", dvec3(1), 0, 1.001);
    // What is left after that distance is the colour; black takes an infinity, or what floats have for it.
    dvec3 absorption;
    for (int c = 0; c < 3; ++c) {
      const double left = std::clamp(colour[c], double(std::numeric_limits<float>::min()), 1.0);
      absorption[c] = -std::log(left) / distance;
    }
    made.absorption = finite(volume, "attenuationDistance", absorption + 0.0);  // −0 becomes 0
  }

  void read_alpha(const Item& item, double factor, Material& made) {
    const std::string mode = item->text("alphaMode", "OPAQUE");
    const double cutoff = item->number("alphaCutoff", 0.5, 0, largest);
    if (mode == "OPAQUE") return;
    if (mode != "MASK" && mode != "BLEND")
      item->refuse_key("alphaMode", "is " + in_quotes(mode) + "; OPAQUE, MASK and BLEND are");
    const Map& colours = made.diffuse_map;
    const bool varies = colours && scene_.textures[static_cast<std::size_t>(colours.texture)].has_alpha;
    if (mode == "MASK" && (cutoff == 0 || (!varies && factor >= cutoff))) return;  // all of it is there
    made.opacity = static_cast<float>(factor);
    if (mode == "MASK") made.alpha_cutoff = static_cast<float>(cutoff);
    if (!varies) return;
    made.opacity_map = colours;  // the same texels: alpha is linear there too
    made.opacity_map.channel = 3;
  }

  vec3 finite(const Item& of, const char* key, const dvec3& value) const {
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(value[c]) <= largest))
        of->refuse_key(key, "makes a number beyond the largest float, 3.4e38; make it less extreme");
    return vec3(value);
  }

  Map map(const Item& of, const char* key, TextureUse use, std::int8_t channel) {
    if (!of->has(key)) return {};
    const Item info = of.part(key);
    const std::size_t number = file_.index(info, "index", List::textures);
    if (!file_.options.textures) {
      const Texture unread = read_texture(file_.item(List::textures, number));
      if (unread.image >= 0) scene_.images_not_read += not_read_.insert(unread.image).second;
      return {};
    }
    const Item transform = info.extension("KHR_texture_transform");
    const std::int64_t coordinates =
        transform->whole("texCoord", info->whole("texCoord", 0, 0, 1000), 0, 1000);
    if (coordinates != 0) {
      ++other_coordinates_;
      return {};
    }
    Map made;
    made.channel = channel;
    made.texture = texture(number, use);
    if (made.texture < 0) return {};
    constexpr double most = 1e9;
    dvec3 scale(1), offset(0);
    for (auto [name, value] : {std::pair("scale", &scale), std::pair("offset", &offset)})
      if (const Json* found = transform->find(name)) {
        const std::vector<double> two = numbers(file_.path, *found, name, 2, -most, most);
        *value = {two[0], two[1], 0};
      }
    // Theirs is v' = oy + sy·v from the top; with 1 − v for each v, ours is (1 − oy − sy) + sy·v.
    made.scale = vec2(scale.x, scale.y);
    made.offset = vec2(offset.x, 1 - offset.y - scale.y);
    turned_ += transform->number("rotation", 0, -largest, largest) != 0;
    return made;
  }

  /// The number in Scene::textures; −1 where there is none.
  std::int32_t texture(std::size_t number, TextureUse use) {
    std::optional<Texture>& known = known_[number];
    if (!known) known = read_texture(file_.item(List::textures, number));
    if (known->image < 0) {
      ++without_image_;
      return -1;
    }
    const auto [found, is_new] = loaded_.try_emplace({known->image, use, known->wrap_u, known->wrap_v}, -1);
    if (is_new)
      found->second = load(static_cast<std::size_t>(known->image), {use, known->wrap_u, known->wrap_v});
    return found->second;
  }

  Texture read_texture(const Item& item) const {
    Texture texture;
    if (item->has("source"))
      texture.image = static_cast<std::int64_t>(file_.index(item, "source", List::images));
    if (item->has("sampler")) {
      const Item sampler = file_.item(List::samplers, file_.index(item, "sampler", List::samplers));
      texture.wrap_u = wrap(sampler, "wrapS");
      texture.wrap_v = wrap(sampler, "wrapT");
    }
    return texture;
  }

  static Wrap wrap(const Item& sampler, const char* key) {
    switch (sampler->whole(key, 10497, 0, 65535)) {
      case 10497:
        return Wrap::repeat;
      case 33071:
        return Wrap::clamp;
      case 33648:
        return Wrap::mirror;
      default:
        sampler->refuse_key(key, "is no way to wrap; 10497 repeats, 33071 clamps, 33648 mirrors");
    }
  }

  std::int32_t load(std::size_t number, const TextureSet::How& how) {
    const Item image = file_.item(List::images, number);
    const std::size_t line = image.json.line;
    if (!image->has("uri")) {
      if (!image->has("bufferView")) image.refuse("has neither 'uri' nor 'bufferView'; give it one");
      const BufferView& view = file_.buffer_view(file_.index(image, "bufferView", List::buffer_views));
      return set_.add(image.what, view.bytes, how, file_.path, line);
    }
    if (const std::optional<std::string> data = file_.data(image))
      return set_.add(image.what, *data, how, file_.path, line);
    return set_.add(file_.named(image), how, file_.path, image->need("uri").line);
  }

  File& file_;
  Scene& scene_;
  TextureSet set_;
  std::map<std::int64_t, std::uint32_t> numbers_;
  std::set<std::int64_t> not_read_;
  std::vector<std::optional<Texture>> known_;
  std::map<std::tuple<std::int64_t, TextureUse, Wrap, Wrap>, std::int32_t> loaded_;
  std::size_t other_coordinates_ = 0, turned_ = 0, without_image_ = 0, infinite_indices_ = 0;
};

// Meshes.

/// Primitives with the same vertices, and which of the mesh's triangles are theirs.
struct Source {
  const Accessor *positions, *normals, *coordinates;
  struct Range {
    std::size_t begin, end;
  };
  std::vector<Range> ranges;
};

/// The vertices that the source's triangles use, in the order of the file. The triangles, which named them by
/// their number in the file, have their place in that list, plus `first`, from then on.
std::vector<std::uint32_t> renumber(const Source& source, std::size_t first, std::vector<uvec3>& triangles) {
  const auto each = [&](const auto& visit) {
    for (const Source::Range& range : source.ranges)
      for (std::size_t i = range.begin; i < range.end; ++i)
        for (int c = 0; c < 3; ++c) visit(triangles[i][c]);
  };
  std::size_t corners = 0;
  each([&](std::uint32_t) { ++corners; });
  const std::size_t count = source.positions->count;
  std::vector<std::uint32_t> used;
  if (count / 8 <= corners) {
    std::vector<std::uint32_t> places(count, 0);
    each([&](std::uint32_t vertex) { places[vertex] = 1; });
    for (std::size_t i = 0; i < count; ++i) {
      if (places[i] == 0) continue;
      places[i] = static_cast<std::uint32_t>(first + used.size());
      used.push_back(static_cast<std::uint32_t>(i));
    }
    each([&](std::uint32_t& vertex) { vertex = places[vertex]; });
  } else {  // a few of many: the many are not gone through for each mesh that has a few
    used.reserve(corners);
    each([&](std::uint32_t vertex) { used.push_back(vertex); });
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    each([&](std::uint32_t& vertex) {
      const auto place = std::lower_bound(used.begin(), used.end(), vertex) - used.begin();
      vertex = static_cast<std::uint32_t>(first + static_cast<std::size_t>(place));
    });
  }
  return used;
}

class Meshes {
 public:
  Meshes(File& file, Accessors& accessors, Materials& materials, bool quantized, Scene& scene)
      : file_(file),
        accessors_(accessors),
        materials_(materials),
        quantized_(quantized),
        scene_(scene),
        numbers_(file.list(List::meshes).size()) {}

  /// The number in Scene::meshes of a mesh of the file; none where that has no triangles.
  std::optional<std::uint32_t> number(std::size_t mesh) {
    std::optional<std::int64_t>& known = numbers_[mesh];
    if (!known) {
      Mesh made = read(file_.item(List::meshes, mesh));
      known = made.triangles.empty() ? -1 : static_cast<std::int64_t>(scene_.meshes.size());
      if (*known >= 0) scene_.meshes.push_back(std::move(made));
    }
    if (*known < 0) return std::nullopt;
    return static_cast<std::uint32_t>(*known);
  }

  void warn(std::vector<std::string>& warnings) const {
    const auto say = [&](std::size_t n, const std::string& what, const std::string& done) {
      if (n > 0) warnings.push_back(file_.path + ": " + counted(n, what) + " " + done);
    };
    say(points_or_lines_, "primitive", "of points or lines left out");
    say(without_positions_, "primitive", "without positions left out");
    say(morphed_, "primitive", "with morph targets shown without them");
    say(coloured_, "primitive", "with vertex colours shown without them");
    say(zero_normals_, "vertex normal", "of zero length made from the faces");
    say(without_normal_, "missing vertex normal", "made from the faces");
    say(without_coordinate_, "missing texture coordinate", "set to (0, 0)");
  }

 private:
  Mesh read(const Item& item) {
    Mesh mesh;
    mesh.name = printable(item->text("name", ""));
    if (mesh.name.empty()) mesh.name = printable(item.what);
    item->need("primitives");
    const std::vector<Json>& primitives = item->list("primitives");
    std::vector<Source> sources;
    std::map<std::array<const Accessor*, 3>, std::size_t> source_numbers;
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      const Item primitive(file_.path, primitives[i], "primitive " + std::to_string(i) + " of " + item.what);
      const std::size_t begin = mesh.triangles.size();
      const std::optional<Source> source = add_triangles(primitive, mesh);
      if (mesh.triangles.size() == begin) continue;
      mesh.materials.resize(mesh.triangles.size(), materials_.number(primitive));
      const auto [found, is_new] = source_numbers.try_emplace(
          {source->positions, source->normals, source->coordinates}, sources.size());
      if (is_new) sources.push_back(*source);
      sources[found->second].ranges.push_back({begin, mesh.triangles.size()});
    }
    fill(item, sources, mesh);
    if (std::all_of(mesh.materials.begin(), mesh.materials.end(), [](std::uint32_t m) { return m == 0; }))
      std::vector<std::uint32_t>().swap(mesh.materials);
    return mesh;
  }

  /// Adds the primitive's triangles, which name vertices by their numbers in the file.
  std::optional<Source> add_triangles(const Item& primitive, Mesh& mesh) {
    enum Mode : std::int64_t { triangles = 4, strip = 5, fan = 6 };
    const std::int64_t mode = primitive->whole("mode", triangles, 0, fan);
    if (mode < triangles) {
      ++points_or_lines_;
      return std::nullopt;
    }
    primitive->need("attributes");
    const Item attributes = primitive.part("attributes");
    if (!attributes->has("POSITION")) {
      ++without_positions_;
      return std::nullopt;
    }
    file_.charge_primitive();
    morphed_ += primitive->has("targets");
    coloured_ += attributes->has("COLOR_0");
    const auto attribute = [&](const char* key, const Wanted& wanted) -> const Accessor* {
      return attributes->has(key) ? &accessors_.get(attributes, key, wanted) : nullptr;
    };
    Source source{attribute("POSITION", quantized_ ? quantized_positions : wanted_positions),
                  attribute("NORMAL", quantized_ ? quantized_normals : wanted_normals),
                  attribute("TEXCOORD_0", quantized_ ? quantized_coordinates : wanted_coordinates),
                  {}};
    const std::size_t vertices = source.positions->count;
    for (const Accessor* other : {source.normals, source.coordinates})
      if (other != nullptr && other->count != vertices)
        attributes.refuse("are " + std::to_string(vertices) + " positions, but " +
                          std::to_string(other->count) + " in " + other->what + "; they take as many");

    const Accessor* const indices =
        primitive->has("indices") ? &accessors_.get(primitive, "indices", wanted_indices) : nullptr;
    const std::size_t corners = indices != nullptr ? indices->count : vertices;
    if (corners < 3 || (mode == triangles && corners % 3 != 0))
      primitive.refuse(
          "has " + counted(corners, "corner") + "; " +
          (mode == triangles ? "triangles take three each" : "strips and fans take at least three"));
    const std::size_t count = mode == triangles ? corners / 3 : corners - 2;
    file_.charge(count, primitive);
    if (mesh.triangles.size() + count > most_elements)
      primitive.refuse("brings its mesh to more than 4294967294 triangles; split it");
    const auto vertex = [&](std::size_t i) {
      if (indices == nullptr) return static_cast<std::uint32_t>(i);
      const auto number = static_cast<std::size_t>((*indices)[i].x);
      if (number >= vertices)
        primitive.refuse("has " + std::to_string(number) + " as index " + std::to_string(i) + "; it has " +
                         counted(vertices, "position") + ", numbered from 0");
      return static_cast<std::uint32_t>(number);
    };
    if (mesh.triangles.empty()) mesh.triangles.reserve(count);  // further ones: as vectors grow
    if (mode == triangles) {
      for (std::size_t i = 0; i < count; ++i)
        mesh.triangles.push_back({vertex(3 * i), vertex(3 * i + 1), vertex(3 * i + 2)});
      return source;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const uvec3 t = mode == fan ? uvec3(vertex(i + 1), vertex(i + 2), vertex(0))
                                  : uvec3(vertex(i), vertex(i + 1 + i % 2), vertex(i + 2 - i % 2));
      if (t.x != t.y && t.y != t.z && t.z != t.x) mesh.triangles.push_back(t);  // else it links two strips
    }
    return source;
  }

  void fill(const Item& item, const std::vector<Source>& sources, Mesh& mesh) {
    const auto has = [&](const Accessor* Source::*part) {
      return std::any_of(sources.begin(), sources.end(), [&](const Source& s) { return s.*part != nullptr; });
    };
    const bool has_normals = has(&Source::normals), has_coordinates = has(&Source::coordinates);
    std::size_t missing = 0;
    for (const Source& source : sources) {
      const std::vector<std::uint32_t> used = renumber(source, mesh.positions.size(), mesh.triangles);
      if (mesh.positions.size() + used.size() > most_elements)
        item.refuse("has more than 4294967294 vertices; split it");
      file_.charge(used.size(), item);
      for (const std::uint32_t vertex : used)
        mesh.positions.push_back(vec3(value(*source.positions, vertex)));
      if (has_coordinates) {
        for (const std::uint32_t vertex : used) {
          if (source.coordinates == nullptr) break;
          const Vec4<double> uv = value(*source.coordinates, vertex);
          mesh.texture_coordinates.push_back(vec2(uv.x, 1 - uv.y));  // theirs runs down from the top
        }
        if (source.coordinates == nullptr) without_coordinate_ += used.size();
        mesh.texture_coordinates.resize(mesh.positions.size(), vec2(0));
      }
      if (has_normals) {
        for (const std::uint32_t vertex : used) {
          if (source.normals == nullptr) break;
          mesh.normals.push_back(unit_or_zero(dvec3(value(*source.normals, vertex))));
        }
        if (source.normals == nullptr) missing += used.size();
        mesh.normals.resize(mesh.positions.size(), vec3(0));
      }
    }
    zero_normals_ += mend_normals(mesh) - missing;
    without_normal_ += missing;
  }

  Vec4<double> value(const Accessor& accessor, std::size_t i) const {
    const Vec4<double> result = accessor[i];
    for (int c = 0; c < accessor.components; ++c)
      if (!std::isfinite(result[c]))
        refuse(file_.path, accessor.line,
               "element " + std::to_string(i) + " of " + accessor.what +
                   " is not finite; only finite numbers are taken");
    return result;
  }

  File& file_;
  Accessors& accessors_;
  Materials& materials_;
  const bool quantized_;
  Scene& scene_;
  std::vector<std::optional<std::int64_t>> numbers_;
  std::size_t points_or_lines_ = 0, without_positions_ = 0, morphed_ = 0, coloured_ = 0, zero_normals_ = 0,
              without_normal_ = 0, without_coordinate_ = 0;
};

// Nodes.

/// However long it is: its squares may neither overflow nor vanish.
dvec3 unit(const dvec3& v) {
  return glm::normalize(v / std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}));
}

/// First scaled, then turned by a quaternion (x, y, z, w) that need not have the length one, then moved.
Transform placed(const dvec3& move, const Vec4<double>& turn, const dvec3& scale) {
  const double s = 2 / glm::dot(turn, turn);
  const double x = turn.x, y = turn.y, z = turn.z, w = turn.w;
  return {scale.x * dvec3(1 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w)),
          scale.y * dvec3(s * (x * y - z * w), 1 - s * (x * x + z * z), s * (y * z + x * w)),
          scale.z * dvec3(s * (x * z + y * w), s * (y * z - x * w), 1 - s * (x * x + y * y)), move};
}

class Nodes {
 public:
  Nodes(File& file, Accessors& accessors, Meshes& meshes, Scene& scene)
      : file_(file), accessors_(accessors), meshes_(meshes), scene_(scene) {
    const std::size_t count = file_.list(List::nodes).size();
    read_tree(count);
    const std::vector<std::size_t> roots = roots_of_scene();
    if (count == 0 && file_.list(List::scenes).empty()) {  // a box of meshes, which nothing places
      for (std::size_t i = 0; i < file_.list(List::meshes).size(); ++i) meshes_.number(i);
      return;
    }
    walk(roots);
    drop_instances_if_plain();
  }

  bool camera_known() const { return !scene_.views.empty(); }

  void warn(std::vector<std::string>& warnings) const {
    const auto say = [&](std::size_t n, const std::string& what, const std::string& done) {
      if (n > 0) warnings.push_back(file_.path + ": " + counted(n, what) + " " + done);
    };
    say(skinned_, "mesh with a skin", "shown unbent");
    say(orthographic_, "orthographic camera", "left out");
    say(other_scenes_, "other scene", "left out");
  }

 private:
  static constexpr std::size_t none = SIZE_MAX;

  /// Sees to it that each node has one parent at most, and that none is its own ancestor.
  void read_tree(std::size_t count) {
    parents_.assign(count, none);
    children_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const Item node = file_.item(List::nodes, i);
      for (const Json& value : node->list("children")) {
        const std::size_t child = file_.index(node, "children", value, List::nodes);
        if (parents_[child] != none)
          refuse(file_.path, value.line,
                 file_.item(List::nodes, child).what + " is a child of " +
                     file_.item(List::nodes, parents_[child]).what + " and of " + node.what +
                     "; a node has one parent, give it a copy");
        parents_[child] = i;
        children_[i].push_back(child);
      }
    }
    // With one parent each, what cannot be reached from a node without is in a circle or below one.
    std::vector<bool> reached(count, false);
    std::vector<std::size_t> stack;
    for (std::size_t i = 0; i < count; ++i)
      if (parents_[i] == none) stack.push_back(i);
    while (!stack.empty()) {
      const std::size_t node = stack.back();
      stack.pop_back();
      reached[node] = true;
      stack.insert(stack.end(), children_[node].begin(), children_[node].end());
    }
    const auto lost = std::find(reached.begin(), reached.end(), false);
    if (lost == reached.end()) return;
    auto node = static_cast<std::size_t>(lost - reached.begin());
    for (std::size_t i = 0; i < count; ++i) node = parents_[node];  // from below a circle into it
    file_.item(List::nodes, node).refuse("is its own ancestor; nodes form trees");
  }

  std::vector<std::size_t> roots_of_scene() {
    const std::size_t count = file_.list(List::scenes).size();
    std::vector<std::size_t> roots;
    const std::size_t number = file_.root->has("scene") ? file_.index(file_.root, "scene", List::scenes) : 0;
    if (count == 0) {
      for (std::size_t i = 0; i < parents_.size(); ++i)
        if (parents_[i] == none) roots.push_back(i);
      return roots;
    }
    other_scenes_ = count - 1;
    const Item scene = file_.item(List::scenes, number);
    std::vector<bool> listed(parents_.size(), false);
    for (const Json& value : scene->list("nodes")) {
      const std::size_t node = file_.index(scene, "nodes", value, List::nodes);
      if (parents_[node] != none)
        refuse(file_.path, value.line,
               scene.what + " lists " + file_.item(List::nodes, node).what + ", a child of " +
                   file_.item(List::nodes, parents_[node]).what + "; it lists nodes without a parent");
      if (listed[node])
        refuse(
            file_.path, value.line,
            scene.what + " lists " + file_.item(List::nodes, node).what + " twice; a node stands once in it");
      listed[node] = true;
      roots.push_back(node);
    }
    return roots;
  }

  /// Parents before their children, children in their order.
  void walk(const std::vector<std::size_t>& roots) {
    struct Step {
      std::size_t node;
      Transform above;
    };
    std::vector<Step> stack;
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) stack.push_back({*root, identity()});
    while (!stack.empty()) {
      const auto [number, above] = stack.back();
      stack.pop_back();
      const Item node = file_.item(List::nodes, number);
      const Transform here = above * local(node);
      visit(node, here);
      for (auto child = children_[number].rbegin(); child != children_[number].rend(); ++child)
        stack.push_back({*child, here});
    }
  }

  Transform local(const Item& node) const {
    if (const Json* matrix = node->find("matrix")) {
      for (const char* key : {"translation", "rotation", "scale"})
        if (node->has(key)) node->refuse_key(key, "stands beside a 'matrix'; one of both tells where it is");
      const std::vector<double> m = numbers(file_.path, *matrix, "matrix", 16, -largest, largest);
      if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
        node->refuse_key("matrix",
                         "has another last row than 0 0 0 1; it takes an affine map, column by column");
      return {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
    }
    Vec4<double> turn(0, 0, 0, 1);
    if (const Json* rotation = node->find("rotation")) {
      const std::vector<double> four = numbers(file_.path, *rotation, "rotation", 4, -largest, largest);
      turn = {four[0], four[1], four[2], four[3]};
      if (!(glm::dot(turn, turn) > std::numeric_limits<double>::min()))
        node->refuse_key("rotation", "has no length; a quaternion x, y, z, w has the length one");
    }
    return placed(node->vector("translation", dvec3(0), -largest, largest), turn,
                  node->vector("scale", dvec3(1), -largest, largest));
  }

  void visit(const Item& node, const Transform& here) {
    const bool has_light = node.has_extension("KHR_lights_punctual");
    if (!node->has("mesh") && !node->has("camera") && !has_light) return;
    check(node, here);
    if (node->has("mesh")) add_instances(node, here);
    if (node->has("camera")) add_camera(node, here);
    if (has_light) add_light(node, here);
  }

  static void check(const Item& node, const Transform& transform) {
    if (is_singular(transform))
      node.refuse(
          "has a singular transform, with those above it: what is there has no size, or none that is "
          "finite; leave the node out, or scale no axis by 0");
  }

  void add_instances(const Item& node, const Transform& here) {
    const auto mesh = meshes_.number(file_.index(node, "mesh", List::meshes));
    if (!mesh) return;
    skinned_ += node->has("skin");
    if (!node.has_extension("EXT_mesh_gpu_instancing")) {
      file_.charge_instances(1, node);  // the node itself is what it takes of the file
      scene_.instances.push_back({*mesh, -1, here});
      return;
    }
    const Item attributes = node.extension("EXT_mesh_gpu_instancing").part("attributes");
    const auto attribute = [&](const char* key, const Wanted& wanted) -> const Accessor* {
      return attributes->has(key) ? &accessors_.get(attributes, key, wanted) : nullptr;
    };
    const Accessor* const moves = attribute("TRANSLATION", wanted_positions);
    const Accessor* const turns = attribute("ROTATION", wanted_rotations);
    const Accessor* const scales = attribute("SCALE", wanted_positions);
    std::size_t count = 0;
    for (const Accessor* part : {moves, turns, scales}) {
      if (part == nullptr) continue;
      if (count != 0 && part->count != count)
        attributes.refuse("differ in their numbers, " + std::to_string(count) + " and " +
                          std::to_string(part->count) + "; they take as many");
      count = part->count;
    }
    if (count == 0) attributes.refuse("place nothing; TRANSLATION, ROTATION or SCALE do");
    constexpr std::size_t in_triangles = 4;  // what one takes in memory
    file_.charge_instances(count, node);
    file_.charge(in_triangles * count, node);
    for (std::size_t i = 0; i < count; ++i) {
      const Vec4<double> turn = turns != nullptr ? (*turns)[i] : Vec4<double>(0, 0, 0, 1);
      const Transform each = here * placed(moves != nullptr ? dvec3((*moves)[i]) : dvec3(0), turn,
                                           scales != nullptr ? dvec3((*scales)[i]) : dvec3(1));
      check(node, each);
      scene_.instances.push_back({*mesh, -1, each});
    }
  }

  /// The point as floats, which it has to fit into.
  vec3 rounded(const Item& node, const dvec3& point) const {
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(point[c]) <= largest))
        node.refuse("lies beyond the largest float, 3.4e38; scale it down");
    return vec3(point);
  }

  void add_camera(const Item& node, const Transform& here) {
    const Item camera = file_.item(List::cameras, file_.index(node, "camera", List::cameras));
    camera->need("type");
    const std::string type = camera->text("type", "");
    if (type == "orthographic") {
      ++orthographic_;
      return;
    }
    if (type != "perspective")
      camera->refuse_key("type", "is " + in_quotes(type) + "; perspective and orthographic are");
    camera->need("perspective");
    const Item perspective = camera.part("perspective");
    perspective->need("yfov");
    View view;
    for (const Item* named : {&node, &camera})
      if (view.name.empty()) view.name = printable((*named)->text("name", ""));
    if (view.name.empty()) view.name = printable(camera.what);
    view.camera.field_of_view = static_cast<float>(perspective->number("yfov", 1, 1e-4, 3.14) * 180 / pi);
    view.camera.eye = rounded(node, here[3]);
    // A target as far away as the origin: nearer, its rounding would turn the camera.
    const double distance = std::max(1.0, glm::length(here[3]));
    view.camera.target = rounded(node, dvec3(view.camera.eye) - distance * unit(here[2]));
    view.camera.up = vec3(unit(here[1]));
    if (scene_.views.empty()) scene_.camera = view.camera;
    scene_.views.push_back(std::move(view));
  }

  void add_light(const Item& node, const Transform& here) {
    const Item from =
        file_.item(List::lights, file_.index(node.extension("KHR_lights_punctual"), "light", List::lights));
    Light light;
    for (const Item* named : {&node, &from})
      if (light.name.empty()) light.name = printable((*named)->text("name", ""));
    if (light.name.empty()) light.name = printable(from.what);
    from->need("type");
    const std::string type = from->text("type", "");
    if (type == "point") {
      light.kind = Light::Kind::point;
    } else if (type == "directional") {
      light.kind = Light::Kind::directional;
    } else if (type == "spot") {
      light.kind = Light::Kind::spot;
    } else {
      from->refuse_key("type", "is " + in_quotes(type) + "; point, spot and directional are");
    }
    light.position = rounded(node, here[3]);
    light.direction = vec3(-unit(here[2]) + 0.0);  // −0 becomes 0
    const dvec3 intensity =
        from->vector("color", dvec3(1), 0, largest) * from->number("intensity", 1, 0, largest);
    for (int c = 0; c < 3; ++c)
      if (!(intensity[c] <= largest))
        from->refuse_key("intensity", "is beyond the largest float, 3.4e38; lower it");
    light.intensity = vec3(intensity);
    if (light.kind != Light::Kind::directional)
      light.range = static_cast<float>(from->number("range", 0, 0, largest));
    if (light.kind == Light::Kind::spot) {
      const Item spot = from.part("spot");
      constexpr double widest = 1.5708;  // 90°, rounded up as exporters do
      const double outer = spot->number("outerConeAngle", pi / 4, 0, widest);
      const double inner = spot->number("innerConeAngle", 0, 0, widest);
      if (!(outer > 0) || inner > outer)
        spot.refuse("has no light between its angles; 0 ≤ innerConeAngle ≤ outerConeAngle, above 0");
      light.outer_angle = static_cast<float>(std::min(90.0, outer * 180 / pi));
      light.inner_angle = static_cast<float>(std::min(90.0, inner * 180 / pi));
    }
    scene_.lights.push_back(std::move(light));
  }

  void drop_instances_if_plain() {
    std::vector<bool> placed(scene_.meshes.size(), false);
    for (const Instance& instance : scene_.instances) {
      if (placed[instance.mesh] || instance.transform != identity()) return;
      placed[instance.mesh] = true;
    }
    scene_.instances.clear();
  }

  File& file_;
  Accessors& accessors_;
  Meshes& meshes_;
  Scene& scene_;
  std::vector<std::size_t> parents_;
  std::vector<std::vector<std::size_t>> children_;
  std::size_t skinned_ = 0, orthographic_ = 0, other_scenes_ = 0;
};

// Extensions.

const std::set<std::string_view> read_extensions = {
    "EXT_mesh_gpu_instancing", "KHR_lights_punctual",        "KHR_materials_emissive_strength",
    "KHR_materials_ior",       "KHR_materials_transmission", "KHR_materials_volume",
    "KHR_mesh_quantization",   "KHR_texture_transform"};

/// Refuses what is required and not read, warns of what is used and not read. Are meshes quantized?
bool check_extensions(const File& file, std::vector<std::string>& warnings) {
  bool quantized = false;
  for (const char* key : {"extensionsRequired", "extensionsUsed"}) {
    std::string unread;
    std::size_t count = 0;
    for (const Json& name : file.root->list(key)) {
      if (name.kind != Json::Kind::text)
        refuse(file.path, name.line,
               in_quotes(key) + " has " + kind_name(name.kind) + " in it; it takes names");
      quantized |= name.text() == "KHR_mesh_quantization";
      if (read_extensions.contains(name.text())) continue;
      if (key[10] == 'R')
        refuse(file.path, name.line,
               "requires the extension " + in_quotes(name.text()) +
                   ", which is not read; save the file without it");
      constexpr std::size_t most_named = 10;
      if (++count <= most_named) unread += (unread.empty() ? "" : ", ") + in_quotes(name.text());
    }
    if (count > 10) unread += " and " + std::to_string(count - 10) + " more";
    if (count > 0)
      warnings.push_back(file.path + ": what the extension" + (count == 1 ? " " : "s ") + unread + " say" +
                         (count == 1 ? "s" : "") + " is left out");
  }
  return quantized;
}

}  // namespace

Scene load_gltf(const std::string& path, const LoadOptions& options) try {
  Scene scene;
  scene.name = fs::path(path).stem().string();
  File file(path, options);
  std::vector<std::string>& warnings = scene.warnings;
  const bool quantized = check_extensions(file, warnings);
  Accessors accessors(file);
  Materials materials(file, scene);
  Meshes meshes(file, accessors, materials, quantized, scene);
  const Nodes nodes(file, accessors, meshes, scene);
  meshes.warn(warnings);
  materials.warn(warnings);
  nodes.warn(warnings);
  if (!file.root->list("animations").empty()) warnings.push_back(path + ": animations are left out");
  if (scene.meshes.empty()) warnings.push_back(path + ": no triangles in its scene: it is empty");
  finish(scene, {0, 1, 0}, nodes.camera_known());
  return scene;
} catch (const std::bad_alloc&) {
  refuse(path, 0, "does not fit into memory; split it");
}

}  // namespace trilha
