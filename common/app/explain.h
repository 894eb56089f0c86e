#pragma once
#include <optional>
#include "common/app/demo.h"
namespace trilha {
struct Saving { Omission omission; std::optional<double> bytes, ms; };
}
