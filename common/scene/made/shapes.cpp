#include "common/scene/made.h"

namespace trilha {

std::vector<MadeScene> box_and_shape_scenes() { return {}; }

}  // namespace trilha
