#pragma once

#include <memory>

#include "common/app/demo.h"

namespace trilha {

std::unique_ptr<Demo> make_uniform_grid_demo();

}  // namespace trilha
