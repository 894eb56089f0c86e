#pragma once

#include <memory>

#include "common/app/demo.h"

namespace trilha {

std::unique_ptr<Demo> make_kd_tree_demo();

}  // namespace trilha
