// 64-bit minimum over all invocations of a number above 32 bits.
#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer minimum_block { uint64_t minimum; };

void main() { atomicMin(minimum, 0x700000000ul - uint64_t(gl_GlobalInvocationID.x)); }
