#include "modules.h"

bool vpl_reference_init(renderer *r)
{
    (void)r;
    return true;
}
