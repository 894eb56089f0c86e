#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The mesh in an OFF file (Geomview's Object File Format, written as text), plain or packed by gzip. The
/// header is [ST][C][N]OFF, or is missing; the numbers of vertices, faces and edges (which may be wrong, or
/// missing) stand behind it or on the next line. Then follows a vertex a line: x y z, with N its normal, with
/// C its colour of 3 or 4 numbers, with ST its texture coordinates; and a face a line: the number of its
/// corners, at most 10 000, their vertices, counted from 0, and a colour of 1, 3 or 4 numbers, or none.
/// Colours are passed over; # begins a comment. Vertices and triangles keep the file's order; polygons are
/// split. The file is read in blocks. Where gzip packed it, it may unpack to 64 MB and 32 times its bytes,
/// and so much may its vertices take and its triangles.
///
/// Throws InputError with the line; and where the file is of the binary kind, has vertices of 4 (4OFF) or n
/// (nOFF) coordinates, or promises more than its bytes can hold or may unpack to.
Scene load_off(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha
