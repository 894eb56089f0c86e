#pragma once
// What the readers of PLY and OFF files share: a mesh made of polygons with any number of corners.

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/block_reader.h"
#include "common/scene/polygon.h"
#include "common/scene/scene.h"

namespace trilha {

/// Makes room for one more, of `expected` in all: little where little has come so far, since what a file
/// promises costs nothing to write. At most 9/8 of the vector's memory is ever in use: what is reserved and
/// not yet written to takes none.
template <class T>
void make_room(std::vector<T>& vector, std::uint64_t expected) {
  if (vector.size() < vector.capacity()) return;
  const std::uint64_t size = vector.size();
  vector.reserve(size < expected ? std::min<std::uint64_t>(expected, std::max<std::uint64_t>(8 * size, 1024))
                                 : size + size / 2 + 1);
}

/// Collects vertices and faces, in any order, and makes a scene of them. Triangles and vertices keep the
/// file's order; a polygon's triangles stand where it stood. Nothing is kept twice.
class PolygonMesh {
 public:
  Mesh mesh;  ///< whose vertices the reader fills in; a normal that has no length is (0, 0, 0) until scene()
  std::vector<std::string> warnings;  ///< those of the scene

  /// Of the file whose bytes these are, and which they outlive.
  explicit PolygonMesh(const BlockReader& bytes)
      : path_(bytes.path()), bytes_(bytes), most_(bytes.most_made(sizeof(uvec3))) {}

  /// So many vertices will be there, with those attributes. Throws InputError where they would take more than
  /// may be made of a packed file.
  void expect_vertices(std::uint64_t n, bool normals, bool texture_coordinates);

  /// All vertices are there from now on: polygons are split at once.
  void vertices_are_known();

  /// Adds a face whose corners, of which there are at most most_corners, are vertices that exist or will.
  /// `expected` faces are thought to come in all. Fewer than three corners make no face: it is counted.
  /// Throws InputError beyond most_triangles, and where they take more than may be made of a packed file.
  void add_face(const std::vector<std::uint32_t>& corners, std::uint64_t expected);

  /// Adds the next triangle of a strip; where it repeats a vertex it is a stitch between strips, no triangle.
  void add_of_strip(const uvec3& triangle);

  /// The scene, with one mesh, or none where no triangle is left, and what there is to say about it.
  Scene scene();

 private:
  /// A polygon whose corners lie in the place of its triangles, until it can be split.
  struct Unsplit {
    std::uint32_t first, corners;
  };

  void push(const uvec3& triangle, std::uint64_t expected);
  void split(const Unsplit& polygon);

  std::string path_;
  const BlockReader& bytes_;
  std::uint64_t most_;  // triangles
  bool vertices_known_ = false;
  std::vector<Unsplit> unsplit_;
  std::vector<std::uint32_t> corners_;  // of the polygon that is split
  std::vector<vec3> points_;
  std::vector<uvec3> split_;
  std::uint64_t without_area_ = 0, too_few_corners_ = 0, crossed_ = 0, stitches_ = 0;
};

/// The name of the scene in that file: without ".gz", and without the ending before it.
std::string scene_name(const std::string& path);

}  // namespace trilha
