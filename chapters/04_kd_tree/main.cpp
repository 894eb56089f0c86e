#include "chapters/04_kd_tree/demo.h"

int main(int argc, char** argv) { return trilha::run_program(argc, argv, trilha::make_kd_tree_demo); }
