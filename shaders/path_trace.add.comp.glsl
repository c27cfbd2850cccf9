// Ends the paths and adds their light to the sums: even samples to one half, odd ones to the other. One invocation a
// pixel, which adds its samples one by one, so that the sums do not depend on how many a frame takes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "path_trace_arrive.glsl.h"

layout(local_size_x = 128) in;
layout(set = 0, binding = 5, scalar) readonly buffer states_block { path_state states[]; };
layout(set = 0, binding = 6, scalar) buffer sums_block { vec4 sums[]; };

void main()
{
    uint pixel = gl_GlobalInvocationID.x;
    if (pixel >= push.pixels)
        return;
    vec3 halves[2] = vec3[2](sums[pixel].rgb, sums[push.pixels + pixel].rgb);
    uint sample_index = push.first_sample;
    for (uint path = pixel; path < push.count; path += push.pixels) {
        path_state state = states[path];
        halves[sample_index & 1u] += state.light + light_arrived(path, state.throughput);
        sample_index++;
    }
    sums[pixel] = vec4(halves[0], 0.0);
    sums[push.pixels + pixel] = vec4(halves[1], 0.0);
}
