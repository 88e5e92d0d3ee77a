// The header as C++, in every standard that it promises.
#include <plumbline/plumbline.h>

static_assert(sizeof(plumb_result) == 4, "fixed width");
