// Whether a ray stops at a triangle whose material has the alpha mask.
#ifndef ALPHA_MASK_GLSL_H
#define ALPHA_MASK_GLSL_H

#include "scene.glsl.h"

bool alpha_passes(surface_hit hit)
{
    surface_vertices v = hit_vertices(hit);
    return hit_base_color(hit, v, 0.0).a >= materials[v.material].alpha_cutoff;
}

#endif
