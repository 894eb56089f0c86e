#include "chapters/03_uniform_grid/demo.h"

int main(int argc, char** argv) { return trilha::run_program(argc, argv, trilha::make_uniform_grid_demo); }
