#include "modules.h"

bool path_trace_init(renderer *r)
{
    (void)r;
    return true;
}
