#include "common/scene/made/shapes.h"

namespace trilha {

std::vector<MadeScene> box_and_shape_scenes() {
  return {cornell_box_scene(), sphereflake_scene(), torus_knot_scene(), terrain_scene()};
}

}  // namespace trilha
