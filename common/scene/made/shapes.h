#pragma once

#include "common/scene/made.h"

namespace trilha {

// What shapes.cpp puts together, each from a file of its own.
MadeScene cornell_box_scene();
MadeScene sphereflake_scene();
MadeScene torus_knot_scene();
MadeScene terrain_scene();

}  // namespace trilha
