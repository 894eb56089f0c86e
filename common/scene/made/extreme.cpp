#include "common/scene/made.h"

namespace trilha {

std::vector<MadeScene> extreme_scenes() { return {}; }

}  // namespace trilha
