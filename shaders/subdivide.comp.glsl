// A refined mesh follows its control cage: limit positions, normals and tangents by the stencils. Where a vertex was is
// kept for motion vectors.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared.h"

layout(local_size_x = SUBDIVIDE_GROUP) in;
layout(set = 0, binding = 0, scalar) buffer positions_block { vec3 positions[]; };
layout(set = 0, binding = 1, scalar) buffer attributes_block { vertex_attributes attributes[]; };
layout(set = 0, binding = 2, scalar) readonly buffer vertices_block { subdivision_vertex vertices[]; };
layout(set = 0, binding = 3, scalar) readonly buffer offsets_block { uint offsets[]; };
layout(set = 0, binding = 4, scalar) readonly buffer entries_block { subdivision_entry entries[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer previous_block { vec3 previous_positions[]; };
layout(push_constant, scalar) uniform step_block { subdivision_step step_; };

// False, and `v` as it was, when it has no direction. Scaled first, so that no length over- or underflows.
bool direction_of(inout vec3 v)
{
    float largest = max(max(abs(v.x), abs(v.y)), abs(v.z));
    if (!(largest > 0.0 && largest < 1e38))
        return false;
    v = normalize(v / largest);
    return true;
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= step_.vertex_count)
        return;
    subdivision_vertex vertex = vertices[step_.first + i];
    vec3 position = vec3(0.0), tangent1 = vec3(0.0), tangent2 = vec3(0.0);
    for (uint k = offsets[vertex.stencil]; k < offsets[vertex.stencil + 1u]; k++) {
        vec3 p = positions[step_.first_source + entries[k].vertex];
        position += entries[k].position * p;
        tangent1 += entries[k].tangent1 * p;
        tangent2 += entries[k].tangent2 * p;
    }
    uint to = step_.first_vertex + i;
    previous_positions[step_.first_kept + i] = step_.is_new != 0u ? position : positions[to];
    positions[to] = position;
    vec3 normal = cross(tangent1, tangent2);
    if (direction_of(normal)) // else the surface has none here, and the last one stays
        attributes[to].normal = normal;
    vec3 tangent = vertex.tangent.x * tangent1 + vertex.tangent.y * tangent2;
    if (direction_of(tangent))
        attributes[to].tangent.xyz = tangent;
}
