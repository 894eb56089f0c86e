#include "common/scene/made.h"

namespace trilha {

std::vector<MadeScene> whitted_scenes() { return {}; }

}  // namespace trilha
