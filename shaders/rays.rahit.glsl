// Lets rays through where an alpha mask does.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "alpha_mask.glsl.h"
#extension GL_EXT_ray_tracing : require

hitAttributeEXT vec2 barycentrics;

void main()
{
    if (!alpha_passes(surface_hit(gl_InstanceID, gl_GeometryIndexEXT, gl_PrimitiveID, barycentrics)))
        ignoreIntersectionEXT;
}
