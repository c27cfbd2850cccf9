// Answers a batch of rays: what is hit first?
#include "rays_trace.glsl.h"

layout(set = 0, binding = 3, scalar) writeonly buffer hits_block { ray_hit hits[]; };

void main()
{
    uint i;
    if (!ray_of(INVOCATION, i))
        return;
    vec4 origin = origins[i];
    surface_hit hit = surface_hit(RAY_MISS, 0u, 0u, vec2(0.0));
    if (origin.w > 0.0 && !ray_nearest(origin.xyz, directions[i].xyz, origin.w, hit))
        hit.instance = RAY_MISS;
    hits[i] = ray_hit(hit.instance, hit.geometry, hit.triangle, hit.barycentrics);
}
