// Moves the vertices of one mesh: morph targets first, then the skin (glTF 2.0, sections 3.7.2.2 and 3.7.3.3). One
// invocation a vertex. Where a vertex was is kept for motion vectors.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) buffer positions_block { vec3 positions[]; };
layout(set = 0, binding = 1, scalar) buffer attributes_block { vertex_attributes attributes[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer previous_block { vec3 previous_positions[]; };
layout(set = 0, binding = 3, scalar) readonly buffer rest_block { deform_vertex rest[]; };
layout(set = 0, binding = 4, scalar) readonly buffer influences_block { deform_influences influences[]; };
layout(set = 0, binding = 5, scalar) readonly buffer offsets_block { deform_offset offsets[]; };
layout(set = 0, binding = 6, scalar) readonly buffer joints_block { deform_joint joints[]; };
layout(set = 0, binding = 7, scalar) readonly buffer targets_block { deform_target targets[]; };
layout(push_constant, scalar) uniform push_block { deform_range range; } push;

vec3 normalize_or(vec3 v, vec3 fallback)
{
    float square = dot(v, v);
    return square > 1e-30 ? v * inversesqrt(square) : fallback;
}

void morph(inout deform_vertex vertex, uint index)
{
    for (uint i = 0u; i < push.range.target_count; i++) {
        deform_target t = targets[push.range.first_target + i];
        deform_offset offset = offsets[t.first_offset + index];
        vertex.position += t.weight * offset.position;
        vertex.normal += t.weight * offset.normal;
        vertex.tangent.xyz += t.weight * offset.tangent;
    }
}

// The mean of the joints' matrices by weight.
deform_joint blend(deform_influences by)
{
    deform_joint mean = deform_joint(vec4[3](vec4(0.0), vec4(0.0), vec4(0.0)));
    for (uint i = 0u; i < DEFORM_INFLUENCES && by.weights[i] > 0.0; i++) {
        uint number = by.joints[i / 2u] >> (16u * (i & 1u)) & 0xffffu;
        deform_joint joint = joints[push.range.first_joint + number];
        for (uint row = 0u; row < 3u; row++)
            mean.rows[row] += by.weights[i] * joint.rows[row];
    }
    return mean;
}

// Normals by the matrix of cofactors: they stay on the side that the winding of the triangles has for its front.
void skin(inout deform_vertex vertex, uint index)
{
    vec4 m[3] = blend(influences[push.range.first_influence + index]).rows;
    vec3 p = vertex.position, n = vertex.normal, t = vertex.tangent.xyz;
    vertex.position = vec3(dot(m[0], vec4(p, 1.0)), dot(m[1], vec4(p, 1.0)), dot(m[2], vec4(p, 1.0)));
    vertex.normal = vec3(dot(cross(m[1].xyz, m[2].xyz), n), dot(cross(m[2].xyz, m[0].xyz), n),
                         dot(cross(m[0].xyz, m[1].xyz), n));
    vertex.tangent.xyz = vec3(dot(m[0].xyz, t), dot(m[1].xyz, t), dot(m[2].xyz, t));
}

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.range.vertex_count)
        return;
    uint kept = push.range.first_kept + index, vertex = push.range.first_vertex + index;
    deform_vertex moved = rest[kept];
    morph(moved, index);
    if (push.range.is_skinned != 0u)
        skin(moved, index);
    previous_positions[kept] = positions[vertex];
    positions[vertex] = moved.position;
    vec3 normal = normalize_or(moved.normal, rest[kept].normal);
    attributes[vertex].normal = normal;
    if (moved.tangent.w != 0.0)
        attributes[vertex].tangent.xyz =
            normalize_or(moved.tangent.xyz - dot(moved.tangent.xyz, normal) * normal, moved.tangent.xyz);
}
