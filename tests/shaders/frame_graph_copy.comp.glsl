// Copies from binding 0 to binding 2: binding 1 is for an optional use that is absent.
#version 460

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer input_block { uint before[]; };
layout(set = 0, binding = 2) writeonly buffer output_block { uint after[]; };

void main() { after[gl_GlobalInvocationID.x] = before[gl_GlobalInvocationID.x]; }
