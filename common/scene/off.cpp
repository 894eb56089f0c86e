#include "common/scene/off.h"

#include <new>
#include <vector>

#include "common/scene/block_reader.h"
#include "common/scene/polygon_mesh.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

using namespace std::string_literals;

class OffReader {
 public:
  explicit OffReader(const std::string& path)
      : path_(path), bytes_(path), text_(bytes_, '#'), mesh_(bytes_) {}

  Scene read() {
    header();
    if (faces_ == 0) {
      for (std::uint64_t i = 0; i < vertices_; ++i) next("vertex", i, vertices_);
    } else {
      mesh_.expect_vertices(vertices_, normals_, texture_coordinates_);
      for (std::uint64_t i = 0; i < vertices_; ++i) vertex(i);
    }
    mesh_.vertices_are_known();
    for (std::uint64_t i = 0; i < faces_; ++i) face(i);
    if (text_.next_line())
      mesh_.warnings.push_back(path_ + ":" + std::to_string(text_.line()) +
                               ": more text after the last face ignored");
    if (colours_ || face_colours_) mesh_.warnings.push_back(path_ + ": not read: colours");
    return mesh_.scene();
  }

 private:
  void header() {
    constexpr std::string_view mark = "\xef\xbb\xbf";
    if (bytes_.holds(mark.size()) && mark == std::string_view(bytes_.begin(), mark.size()))
      bytes_.move_to(bytes_.begin() + mark.size());
    if (!bytes_.holds(1)) refuse(path_, 0, "is empty; an OFF file begins with a line \"OFF\"");
    if (!text_.next_line())
      text_.refuse_here("the file ends before its header; it begins with a line \"OFF\"");
    if (const std::size_t length = keyword(); length > 0) {
      bytes_.move_to(bytes_.begin() + length);
      if (bytes_.holds(2) && bytes_.begin()[0] == ' ' && bytes_.begin()[1] == 'B') {
        if (text_.word() == "BINARY")
          text_.refuse_here("a binary OFF file; only those written as text are read, PLY may be binary");
        text_.refuse_here("the header goes on in words; numbers of vertices and faces should follow");
      }
      if (text_.line_ends() && !text_.next_line())
        text_.refuse_here("the file ends in its header; numbers of vertices and faces should follow");
    }
    vertices_ = count("the number of vertices", most_vertices);
    faces_ = count("the number of faces", most_triangles);
    if (!text_.line_ends()) text_.whole("the number of edges");
    if (!text_.line_ends())
      text_.refuse_here("more than three numbers; those of vertices, faces and edges stand on this line");
    const std::uint64_t of_vertex =
        2 * (3 + (normals_ ? 3 : 0) + (colours_ ? 3 : 0) + (texture_coordinates_ ? 2 : 0));
    const std::uint64_t left = bytes_.most_left() + 1;  // the last line may lack its end
    if (vertices_ * of_vertex + faces_ * 2 > left)
      text_.refuse_here(std::to_string(vertices_) + " vertices and " + std::to_string(faces_) +
                        " faces take at least " + std::to_string(of_vertex) + " and 2 bytes each; " +
                        bytes_.left_for_them(left));
  }

  /// How long the keyword is that the text stands at: 0 where there is none, as Geomview allows. Data sets
  /// (ModelNet) are around whose counts follow it without a space.
  std::size_t keyword() {
    bytes_.holds(16);
    const std::string_view here(bytes_.begin(), static_cast<std::size_t>(bytes_.end() - bytes_.begin()));
    std::size_t at = 0;
    const auto takes = [&](std::string_view letters) {
      const bool there = here.substr(at).starts_with(letters);
      if (there) at += letters.size();
      return there;
    };
    texture_coordinates_ = takes("ST");
    colours_ = takes("C");
    normals_ = takes("N");
    const bool homogeneous = takes("4"), dimensional = takes("n");
    if (takes("OFF")) {
      if (homogeneous) text_.refuse_here("a 4OFF file, of homogeneous coordinates; three a vertex are read");
      if (dimensional)
        text_.refuse_here("an nOFF file, of any number of coordinates; three a vertex are read");
      return at;
    }
    texture_coordinates_ = colours_ = normals_ = false;
    if (here[0] < '0' || here[0] > '9')
      text_.refuse_here("no OFF file; one begins with OFF, COFF, NOFF, STOFF or with letters of several");
    return 0;
  }

  std::uint64_t count(const char* what, std::size_t most) {
    const std::int64_t n = text_.whole(what);
    if (n < 0 || static_cast<std::uint64_t>(n) > most)
      text_.refuse_here(std::to_string(n) + " is not " + what + "; from 0 to " + std::to_string(most) +
                        " are possible");
    return static_cast<std::uint64_t>(n);
  }

  void next(const char* what, std::uint64_t i, std::uint64_t of) {
    if (!text_.next_line())
      text_.refuse_here(std::string("the file ends where ") + what + " " + std::to_string(i + 1) + " of " +
                        std::to_string(of) + " should stand; was it cut off?");
  }

  vec3 three(const char* a, const char* b, const char* c) {
    vec3 result;
    result.x = text_.real<float>(a);
    result.y = text_.real<float>(b);
    result.z = text_.real<float>(c);
    return result;
  }

  void vertex(std::uint64_t i) {
    next("vertex", i, vertices_);
    Mesh& mesh = mesh_.mesh;
    make_room(mesh.positions, vertices_);
    mesh.positions.push_back(three("x", "y", "z"));
    if (normals_) {
      make_room(mesh.normals, vertices_);
      mesh.normals.push_back(unit_or_zero(three("the normal's x", "the normal's y", "the normal's z")));
    }
    // A colour has three numbers or four: the texture coordinates are the two after it.
    float rest[6];
    std::size_t n = 0;
    for (; n < 6 && !text_.line_ends(); ++n) rest[n] = text_.real<float>("a number");
    const std::size_t least = (colours_ ? 3 : 0) + (texture_coordinates_ ? 2 : 0);
    if (!text_.line_ends() || n < least || n > least + colours_)
      text_.refuse_here(std::string(n < least ? "fewer" : "more") +
                        " numbers than the header wants of a vertex; it says " + header_says());
    if (texture_coordinates_) {
      make_room(mesh.texture_coordinates, vertices_);
      mesh.texture_coordinates.push_back({rest[n - 2], rest[n - 1]});
    }
  }

  std::string header_says() const {
    return std::string(texture_coordinates_ ? "ST" : "") + (colours_ ? "C" : "") + (normals_ ? "N" : "") +
           "OFF";
  }

  void face(std::uint64_t i) {
    next("face", i, faces_);
    const std::uint64_t n = count("a number of corners", most_corners);
    corners_.clear();
    for (std::uint64_t corner = 0; corner < n; ++corner) {
      const std::int64_t index = text_.whole("a vertex number");
      if (index < 0 || static_cast<std::uint64_t>(index) >= vertices_)
        text_.refuse_here("vertex " + std::to_string(index) + " does not exist; the file has " +
                          std::to_string(vertices_) + ", counted from 0");
      corners_.push_back(static_cast<std::uint32_t>(index));
    }
    colour_of_face();
    mesh_.add_face(corners_, faces_);
  }

  /// Goes over it, if there is one: a number in a table of colours, or 3 or 4 numbers.
  void colour_of_face() {
    int n = 0;
    for (; n < 5 && !text_.line_ends(); ++n) text_.real<float>("a colour");
    if (n == 2 || n == 5)
      text_.refuse_here((n == 2 ? "2"s : "more than 4"s) +
                        " numbers after a face's last vertex; a colour there has 1, 3 or 4");
    face_colours_ |= n > 0;
  }

  const std::string& path_;
  BlockReader bytes_;
  TextReader text_;
  PolygonMesh mesh_;
  bool normals_ = false, colours_ = false, texture_coordinates_ = false, face_colours_ = false;
  std::uint64_t vertices_ = 0, faces_ = 0;
  std::vector<std::uint32_t> corners_;
};

}  // namespace

Scene load_off(const std::string& path, const LoadOptions&) try {
  return OffReader(path).read();
} catch (const std::bad_alloc&) {
  refuse(path, 0, "does not fit into memory; split it");
}

}  // namespace trilha
