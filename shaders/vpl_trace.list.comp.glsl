// Lists the paths whose bit is set, in ascending order. One workgroup: the mask of 100,000 slots has about 1,000 words.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIST_BINDING 0
#define LIST_ACCESS writeonly
#include "vpl_trace.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 1, scalar) readonly buffer mask_block { uint mask[]; };
layout(push_constant, scalar) uniform push_block { uint word_count; } push;

shared uint sums[256];

void main()
{
    uint lane = gl_LocalInvocationIndex;
    uint words = (push.word_count + 255u) / 256u; // of an invocation
    uint begin = min(lane * words, push.word_count), end = min(begin + words, push.word_count);
    uint count = 0u;
    for (uint word = begin; word < end; word++)
        count += bitCount(mask[word]);
    sums[lane] = count;
    for (uint step = 1u; step < 256u; step *= 2u) {
        barrier();
        uint before = lane >= step ? sums[lane - step] : 0u;
        barrier();
        sums[lane] += before;
    }
    uint next = sums[lane] - count;
    for (uint word = begin; word < end; word++)
        for (uint bits = mask[word]; bits != 0u; bits &= bits - 1u)
            list_paths[next++] = word * 32u + findLSB(bits);
    if (lane == 255u) {
        list_count = sums[255];
        list_dispatch = uvec3((sums[255] + 63u) / 64u, 1u, 1u);
    }
}
