// One link of a chain: mixes each number with its neighbour.
#version 460

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer input_block { uint before[]; };
layout(set = 0, binding = 1) writeonly buffer output_block { uint after[]; };

void main()
{
    uint i = gl_GlobalInvocationID.x;
    after[i] = before[i] * 1664525u + before[(i + 1u) % before.length()];
}
