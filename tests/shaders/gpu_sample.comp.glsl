// Samples texture `texture_index` of the scene at a point and a level for each invocation.
#version 460
#extension GL_EXT_nonuniform_qualifier : require

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) readonly buffer point_block { vec4 points[]; }; // u, v, level, texture
layout(set = 0, binding = 1) writeonly buffer output_block { vec4 values[]; };
layout(set = 1, binding = 12) uniform sampler2D textures[];

void main()
{
    vec4 p = points[gl_WorkGroupID.x];
    values[gl_WorkGroupID.x] = textureLod(textures[nonuniformEXT(uint(p.w))], p.xy, p.z);
}
