// Answers a batch of rays: is anything in the way?
#include "rays_trace.glsl.h"

layout(set = 0, binding = 3, scalar) writeonly buffer visible_block { uint visible[]; };

void main()
{
    uint i;
    if (!ray_of(INVOCATION, i))
        return;
    vec4 origin = origins[i];
    if (origin.w > 0.0)
        visible[i] = uint(ray_visible(origin.xyz, directions[i].xyz, origin.w));
}
