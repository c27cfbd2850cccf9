// Finds the scale that meets the budget, by one workgroup: 256 guesses over all the scales there are, then 256 between
// the best two. Not every sample makes a ray (its light may face away); what share did last frame is what will.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shadow_budget.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) buffer header_block { budget_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer previous_header_block { budget_header previous_header; };
layout(set = 0, binding = 2, scalar) readonly buffer rays_block { uint previous_rays; };
layout(push_constant, scalar) uniform push_block {
    float budget, most; // rays a pixel of the picture, and samples a pixel
    uint history_valid;
} push;

shared uint counts[2u * PRIORITIES];
shared float totals[PRIORITIES];

float total_of(float scale)
{
    float total = 0.0;
    for (uint i = 0u; i < 2u * PRIORITIES; i++)
        if (counts[i] > 0u)
            total += float(counts[i]) * budget_samples(1u + i, scale, push.budget, push.most);
    return total;
}

// The largest of the guesses 2^(first + step * i) whose total is within what is wanted, as its exponent; the first, if
// none is. Totals rise with the scale.
float best_guess(uint thread, float first, float step, float wanted)
{
    totals[thread] = total_of(exp2(first + step * float(thread)));
    barrier();
    uint best = 0u;
    for (uint i = 1u; i < PRIORITIES; i++)
        best = totals[i] <= wanted ? i : best;
    barrier();
    return first + step * float(best);
}

void main()
{
    uint thread = gl_LocalInvocationIndex;
    counts[thread] = header.counts[thread];
    counts[thread + PRIORITIES] = header.counts[thread + PRIORITIES];
    barrier();
    float share = 1.0; // of the samples, that make a ray
    if (push.history_valid != 0u && previous_header.planned > 0.0)
        share = clamp(float(previous_rays) / previous_header.planned, 0.01, 1.0);
    float wanted = push.budget * float(frame.width * frame.height) / share;
    float exponent = best_guess(thread, -64.0, 0.5, wanted);
    exponent = best_guess(thread, exponent, 0.5 / float(PRIORITIES), wanted);
    if (thread == 0u) {
        header.scale = exp2(exponent);
        header.planned = total_of(header.scale);
    }
}
