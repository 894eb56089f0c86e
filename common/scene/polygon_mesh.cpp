#include "common/scene/polygon_mesh.h"

#include <filesystem>

#include "common/scene/text.h"

namespace trilha {

std::string scene_name(const std::string& path) {
  std::filesystem::path name = std::filesystem::path(path).filename();
  if (name.extension() == ".gz") name = name.stem();
  return name.stem().string();
}

void PolygonMesh::expect_vertices(std::uint64_t n, bool normals, bool texture_coordinates) {
  const std::size_t each =
      sizeof(vec3) + (normals ? sizeof(vec3) : 0) + (texture_coordinates ? sizeof(vec2) : 0);
  if (n > bytes_.most_made(each)) bytes_.refuse_to_make("vertices");
}

void PolygonMesh::push(const uvec3& triangle, std::uint64_t expected) {
  if (mesh.triangles.size() == most_triangles)
    refuse(path_, 0, "more than 4294967294 triangles; split the file");
  if (mesh.triangles.size() == most_) bytes_.refuse_to_make("triangles");
  make_room(mesh.triangles, expected);
  mesh.triangles.push_back(triangle);
}

void PolygonMesh::add_face(const std::vector<std::uint32_t>& corners, std::uint64_t expected) {
  if (corners.size() < 3) {
    ++too_few_corners_;
    return;
  }
  if (corners.size() == 3) {
    const uvec3 t(corners[0], corners[1], corners[2]);
    without_area_ += t.x == t.y || t.y == t.z || t.z == t.x;
    push(t, expected);
    return;
  }
  // n corners fit into n − 2 triangles.
  const Unsplit polygon{static_cast<std::uint32_t>(mesh.triangles.size()),
                        static_cast<std::uint32_t>(corners.size())};
  for (std::size_t i = 0; i < corners.size() - 2; ++i) push(uvec3(0), expected);
  for (std::size_t i = 0; i < corners.size(); ++i)
    mesh.triangles[polygon.first + i / 3][static_cast<int>(i % 3)] = corners[i];
  if (vertices_known_) {
    split(polygon);
  } else {
    unsplit_.push_back(polygon);
  }
}

void PolygonMesh::split(const Unsplit& polygon) {
  corners_.clear();
  points_.clear();
  for (std::size_t i = 0; i < polygon.corners; ++i) {
    corners_.push_back(mesh.triangles[polygon.first + i / 3][static_cast<int>(i % 3)]);
    points_.push_back(mesh.positions[corners_.back()]);
  }
  crossed_ += !split_polygon(points_, split_);
  for (std::size_t i = 0; i < split_.size(); ++i) {
    const uvec3& t = split_[i];
    mesh.triangles[polygon.first + i] = {corners_[t.x], corners_[t.y], corners_[t.z]};
  }
}

void PolygonMesh::vertices_are_known() {
  vertices_known_ = true;
  for (const Unsplit& polygon : unsplit_) split(polygon);
  std::vector<Unsplit>().swap(unsplit_);
}

void PolygonMesh::add_of_strip(const uvec3& t) {
  if (t.x == t.y || t.y == t.z || t.z == t.x) {
    ++stitches_;
  } else {
    push(t, 0);
  }
}

Scene PolygonMesh::scene() {
  Scene scene;
  scene.name = scene_name(path_);
  const auto warn = [&](std::uint64_t n, const char* what, const std::string& consequence) {
    if (n > 0) warnings.push_back(path_ + ": " + counted(n, what) + consequence);
  };
  warn(crossed_, "polygon", " twisted, crossing itself or without area, split as well as could be");
  warn(without_area_, "face", " with a vertex twice: triangles without area, kept");
  warn(too_few_corners_, "face", " with fewer than 3 corners left out");
  warn(stitches_, "triangle", " of strips that had a vertex twice, stitches between them, left out");
  if (mesh.triangles.empty()) {
    warnings.push_back(path_ + ": no faces in it: the scene is empty");
  } else {
    warn(mend_normals(mesh), "vertex normal", " of zero length made from the faces");
    mesh.name = scene.name;
    scene.meshes.push_back(std::move(mesh));
  }
  scene.warnings = std::move(warnings);
  finish(scene, {0, 1, 0}, false);
  return scene;
}

}  // namespace trilha
