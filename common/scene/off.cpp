#include "common/scene/off.h"

#include "common/scene/text.h"

namespace trilha {

Scene load_off(const std::string& path, const LoadOptions&) { refuse(path, 0, "is not read yet; wait"); }

}  // namespace trilha
