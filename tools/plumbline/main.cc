// The plumbline program.
#include "tools/plumbline/program.h"

int main(int argc, char** argv) { return plumb::tools::RunProgram(argc, argv); }
