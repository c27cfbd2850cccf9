// One corner of a triangle of the drawn primitive, pulled from the scene's buffers: gl_VertexIndex is a corner number of
// modules/clusters.h. Positions leave relative to the eye, so that world coordinates far from the origin cost no
// precision. What the draw does not need is left undefined.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gbuffer_draw.glsl.h"

layout(location = 0) out vec3 out_relative;          // world, minus the eye
layout(location = 1) out vec3 out_previous_relative; // last frame's, minus last frame's eye
layout(location = 2) out vec3 out_normal;            // of the winding's front side, not unit
layout(location = 3) out vec4 out_tangent;           // not unit; w: sign of the bitangent in the world, 0: none
layout(location = 4) out vec4 out_uvs;
layout(location = 5) out vec4 out_color;
layout(location = 6) flat out vec3 out_geometric; // as out_normal, of the flat triangle

vec3 rows_rotate(vec4 rows[3], vec3 v) { return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v)); }

// The rotation first and the difference of the translations after: exact for what stands near the eye.
vec3 relative_position(vec4 rows[3], vec3 p, vec3 eye)
{
    return rows_rotate(rows, p) + (vec3(rows[0].w, rows[1].w, rows[2].w) - eye);
}

// Where the vertex was in the last frame, mesh space.
vec3 previous_position(uint vertex)
{
    mesh_instance_gpu instance = instances[draw.instance];
    return previous_positions[instance.previous_vertex + vertex - primitives[instance.first_primitive].first_vertex];
}

void main()
{
    mesh_primitive primitive = primitives[draw.primitive];
    uint corner = uint(gl_VertexIndex) % 3u;
    uint first = primitive.first_index + uint(gl_VertexIndex) - corner;
    uvec3 triangle = uvec3(indices[first], indices[first + 1u], indices[first + 2u]) + primitive.first_vertex;
    uint vertex = triangle[corner];
    vec3 a = positions[triangle.x], b = positions[triangle.y], c = positions[triangle.z];
    vec3 position = corner == 0u ? a : corner == 1u ? b : c;
    vertex_attributes own = attributes[vertex];

    vec4 world[3] = instances[draw.instance].world;
    vec4 normal_matrix[3] = instances[draw.instance].normal_matrix;
    float handedness = instances[draw.instance].mirrored != 0u ? -1.0 : 1.0;
    out_relative = relative_position(world, position, frame.eye);
    if (MOVES)
        out_previous_relative = relative_position(instances[draw.instance].previous_world,
                                                  DEFORMS ? previous_position(vertex) : position, frame.previous_eye);
    out_normal = rows_rotate(normal_matrix, own.normal);
    out_geometric = rows_rotate(normal_matrix, cross(b - a, c - a));
    if (NORMAL_TEXTURE)
        out_tangent = vec4(rows_rotate(world, own.tangent.xyz), own.tangent.w * handedness);
    if (BASE_TEXTURE || EMISSIVE_TEXTURE || NORMAL_TEXTURE)
        out_uvs = vec4(own.uv0, own.uv1);
    if (VERTEX_COLORS)
        out_color = vertex_color(own);

    gl_Position = frame.view_projection * vec4(out_relative, 0.0);
    gl_Position.z = frame.near_plane; // what the eye's translation leaves of the third row
}
