#pragma once

#include <memory>

#include "common/app/demo.h"

namespace trilha {

std::unique_ptr<Demo> make_whitted_demo();

}  // namespace trilha
