#include "chapters/01_ray_casting/demo.h"

int main(int argc, char** argv) { return trilha::run_program(argc, argv, trilha::make_ray_casting_demo); }
