// The priority of each pixel's shadow samples, and how many pixels have which. The error of a pixel falls with the
// samples like (light * deviation) / sqrt(n), so that for the smallest sum of squares n goes like light * deviation
// (Neyman 1934); the light counts by its root, since the eye judges dark pixels too.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "interleave.glsl.h"
#define REPROJECT_BINDING 2
#include "reproject.glsl.h"
#include "shadow_budget.glsl.h"
#include "svgf.glsl.h"

layout(local_size_x = 16, local_size_y = 16) in;
layout(set = 0, binding = 0, scalar) buffer header_block { budget_header header; };
layout(set = 0, binding = 1, scalar) writeonly buffer plan_block { uint plan[]; };
layout(set = 0, binding = 9) uniform sampler2D indirect_map;
layout(set = 0, binding = 10) uniform sampler2D previous_unshadowed;
layout(set = 0, binding = 11) uniform sampler2D previous_shadowed;
layout(set = 0, binding = 12) uniform sampler2D previous_moments;
layout(push_constant, scalar) uniform push_block { uint interleave, history_valid; } push;

// Samples of a history; below, its variance means nothing. With 4, the pixels whose first samples were all occluded by
// chance stayed black dots: no variance, so no samples, and the filter takes them for certain.
const float FRAMES_MIN = 8.0;
const float DEVIATION_NEW = 0.5;
const float PRIOR = 2.0; // samples that the expectation of DEVIATION_NEW is worth

shared uint counts[2u * PRIORITIES];

// Of the ratio, of one sample.
float deviation_of(ivec2 tap)
{
    float u = luminance(texelFetch(previous_unshadowed, tap, 0).rgb);
    float s = luminance(texelFetch(previous_shadowed, tap, 0).rgb);
    vec4 moments = texelFetch(previous_moments, tap, 0);
    float variance = mix(svgf_variance(u, s, moments.xyz).x, DEVIATION_NEW * DEVIATION_NEW, PRIOR / (PRIOR + moments.w));
    return sqrt(variance);
}

// 0: the pixel has no indirect light.
uint entry_of(uvec2 pixel)
{
    gbuffer_point point;
    if (!gbuffer_read(depth_map, normal_map, pixel, point))
        return 0u;
    uvec2 texel = interleave_texel(pixel, push.interleave, uvec2(frame.width, frame.height));
    float light = texelFetch(indirect_map, ivec2(texel), 0).a;
    if (!(light > 0.0))
        return 0u;
    reprojection r;
    if (push.history_valid == 0u || !reproject(pixel, point, r))
        return priority_entry(sqrt(light) * DEVIATION_NEW, true);
    // The tap with the most weight stands for all.
    int best = 0;
    for (int i = 1; i < 4; i++)
        best = r.weights[i] > r.weights[best] ? i : best;
    ivec2 tap = reprojection_tap(r, best);
    bool is_new = texelFetch(previous_moments, tap, 0).w < FRAMES_MIN;
    return priority_entry(sqrt(light) * (is_new ? DEVIATION_NEW : deviation_of(tap)), is_new);
}

void main()
{
    uint thread = gl_LocalInvocationIndex;
    counts[thread] = counts[thread + PRIORITIES] = 0u;
    barrier();
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (all(lessThan(pixel, uvec2(frame.width, frame.height)))) {
        uint entry = entry_of(pixel);
        plan[pixel.y * frame.width + pixel.x] = entry;
        if (entry != 0u)
            atomicAdd(counts[entry - 1u], 1u);
    }
    barrier();
    for (uint i = thread; i < 2u * PRIORITIES; i += PRIORITIES)
        if (counts[i] > 0u)
            atomicAdd(header.counts[i], counts[i]);
}
