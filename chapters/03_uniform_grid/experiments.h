#pragma once

#include "chapters/03_uniform_grid/structure_trials.h"

namespace trilha {

/// A contender for each traversal of a grid by density.
std::vector<Contender> grid_contenders();

/// Times over the resolution, and pictures over build and render time.
std::vector<Experiment> uniform_grid_experiments();

}  // namespace trilha
