// Fills a buffer with numbers that depend on the index and a seed.
#version 460

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) writeonly buffer output_block { uint numbers[]; };
layout(push_constant) uniform push { uint seed; };

void main() { numbers[gl_GlobalInvocationID.x] = gl_GlobalInvocationID.x * 2654435761u + seed; }
