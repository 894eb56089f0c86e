#pragma once

#include <memory>

#include "common/app/demo.h"

namespace trilha {

std::unique_ptr<Demo> make_ray_casting_demo();

}  // namespace trilha
