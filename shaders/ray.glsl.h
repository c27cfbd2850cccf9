// Rays by ray query over the scene's acceleration structure, alpha mask respected. Before including, define TLAS_BINDING.
#ifndef RAY_GLSL_H
#define RAY_GLSL_H

#include "alpha_mask.glsl.h"
#extension GL_EXT_ray_query : require

layout(set = 0, binding = TLAS_BINDING) uniform accelerationStructureEXT tlas;

// Steps the query to its end; candidates are triangles with an alpha mask. A macro, since glslang cannot pass queries.
#define RAY_PROCEED(query)                                                                                             \
    while (rayQueryProceedEXT(query))                                                                                  \
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionTriangleEXT &&             \
            alpha_passes(surface_hit(rayQueryGetIntersectionInstanceIdEXT(query, false),                               \
                                     rayQueryGetIntersectionGeometryIndexEXT(query, false),                            \
                                     rayQueryGetIntersectionPrimitiveIndexEXT(query, false),                           \
                                     rayQueryGetIntersectionBarycentricsEXT(query, false))))                           \
    rayQueryConfirmIntersectionEXT(query)

// Nearest hit of the ray within `distance`; false: none.
bool ray_nearest(vec3 origin, vec3 direction, float distance, out surface_hit hit)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, tlas, gl_RayFlagsNoneEXT, 0xff, origin, 0.0, direction, distance);
    RAY_PROCEED(query);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT)
        return false;
    hit = surface_hit(rayQueryGetIntersectionInstanceIdEXT(query, true),
                      rayQueryGetIntersectionGeometryIndexEXT(query, true),
                      rayQueryGetIntersectionPrimitiveIndexEXT(query, true),
                      rayQueryGetIntersectionBarycentricsEXT(query, true));
    return true;
}

// Whether nothing lies on the segment from `origin` along the unit `direction`, `distance` long. Infinite for suns: 1e30.
bool ray_visible(vec3 origin, vec3 direction, float distance)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, tlas, gl_RayFlagsTerminateOnFirstHitEXT, 0xff, origin, 0.0, direction, distance);
    RAY_PROCEED(query);
    return rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT;
}

#endif
