// Adds the light of `count` slots to each pixel's sum; with SHADOWED, of those that its rays reached.
#ifndef VPL_REFERENCE_SUM_GLSL_H
#define VPL_REFERENCE_SUM_GLSL_H

#include "vpl_reference.glsl.h"

layout(set = 0, binding = 3, scalar) buffer sums_block { vec4 sums[]; };
#ifdef SHADOWED
layout(set = 0, binding = 4, scalar) readonly buffer origins_block { vec4 origins[]; };
layout(set = 0, binding = 5, scalar) readonly buffer visible_block { uint visible[]; };
#endif

void main()
{
    uint pixel = gl_GlobalInvocationID.x, pixels = frame.width * frame.height;
    gbuffer_point p;
    if (pixel >= pixels || !pixel_read(pixel, p))
        return;
    vec3 sum = vec3(0.0);
    for (uint layer = 0u; layer < push.count; layer++) {
#ifdef SHADOWED
        uint ray = layer * pixels + pixel;
        if (origins[ray].w <= 0.0 || visible[ray] == 0u)
            continue;
#endif
        sum += slot_light(push.first + layer, p);
    }
    sums[pixel].rgb += sum;
}

#endif
