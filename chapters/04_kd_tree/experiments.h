#pragma once

#include "chapters/03_uniform_grid/structure_trials.h"

namespace trilha {

/// A contender for each way through the tree.
std::vector<Contender> kd_contenders();

/// Ways through the tree, rules to split by, the grid against the tree where triangles lie unevenly, pictures
/// over build and render time.
std::vector<Experiment> kd_tree_experiments();

}  // namespace trilha
