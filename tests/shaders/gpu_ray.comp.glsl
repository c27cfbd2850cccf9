// Traces one ray an invocation; of non-opaque geometry only the triangles with an odd index are solid.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_scalar_block_layout : require

struct ray {
    vec3 origin;
    vec3 direction;
};
struct hit {
    float t; // -1: none
    uint instance;
    uint primitive;
    uint candidates;
};

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT tlas;
layout(set = 0, binding = 1, scalar) readonly buffer ray_block { ray rays[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer hit_block { hit hits[]; };

void main()
{
    ray r = rays[gl_WorkGroupID.x];
    hit h = hit(-1.0, 0u, 0u, 0u);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, tlas, gl_RayFlagsNoneEXT, 0xff, r.origin, 0.0, r.direction, 1e4);
    while (rayQueryProceedEXT(query)) {
        h.candidates++;
        if ((rayQueryGetIntersectionPrimitiveIndexEXT(query, false) & 1) == 1)
            rayQueryConfirmIntersectionEXT(query);
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        h.t = rayQueryGetIntersectionTEXT(query, true);
        h.instance = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
        h.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
    }
    hits[gl_WorkGroupID.x] = h;
}
