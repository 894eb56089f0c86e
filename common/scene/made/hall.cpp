#include "common/scene/made.h"

namespace trilha {

std::vector<MadeScene> hall_scenes() { return {}; }

}  // namespace trilha
