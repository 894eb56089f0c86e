#include "chapters/02_whitted/demo.h"

int main(int argc, char** argv) { return trilha::run_program(argc, argv, trilha::make_whitted_demo); }
