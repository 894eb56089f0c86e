#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The mesh in a PLY file (Turk, The PLY Polygon File Format, 1994): ASCII or binary of either byte order,
/// plain or packed by gzip, which its first bytes say. Elements and properties may come in any order; of them
/// are read
///
/// - vertex: x y z, nx ny nz, and u v, s t, texture_u texture_v or texture_s texture_t;
/// - face: the list vertex_indices or vertex_index of at most 10 000 corners, split where it has more than
/// three;
/// - tristrips: the list vertex_indices or vertex_index, where −1 begins another strip.
///
/// Everything else is passed over and named in a warning. Vertices and triangles keep the file's order, also
/// those that nothing uses or that repeat a vertex. In ASCII an element stands on a line of its own, as in
/// Turk's own programs. The file is read in blocks: memory holds the mesh and half a megabyte, whatever the
/// file promises. Where gzip packed it, it may unpack to 64 MB and 32 times its bytes, and
/// so much may its vertices take and its triangles; real meshes unpack to 1.2 to 8 times their bytes.
///
/// Throws InputError, with the line where the file is ASCII, else with the element and its number, counted
/// from 1: where the header is malformed or promises more than the file's bytes can hold or may unpack to,
/// more than 2³¹ − 1 vertices or 2³² − 2 triangles; where a number is malformed or not finite as a float, or
/// an index has no vertex; where the file ends too early, or what gzip packed is damaged or unpacks to more.
Scene load_ply(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha
