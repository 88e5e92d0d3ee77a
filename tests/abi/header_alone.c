/* The header needs nothing before it. Compiled once for each standard of C and, by inclusion, C++.
 */
#include <plumbline/plumbline.h>

int plumb_header_stands_alone(void);
int plumb_header_stands_alone(void) { return (int)sizeof(plumb_frame); }
