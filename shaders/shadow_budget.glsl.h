// Spending a budget of shadow rays where the filter needs them. Each pixel has a priority p, in steps of a quarter
// octave; it gets clamp(scale * p, least, most) samples in expectation, and `scale` is such that all together trace what
// the budget allows. Counts of pixels by priority are exact, so that the scale is the same whatever the order.
#ifndef SHADOW_BUDGET_GLSL_H
#define SHADOW_BUDGET_GLSL_H

#include "scene.glsl.h"

const uint PRIORITIES = 256u;
// A pixel's entry in the plan: 0: no light; else 1 + priority, and NEW where the filter has little history.
const uint PRIORITY_NEW = 256u;
const float STEPS = 4.0; // an octave

struct budget_header {
    uint counts[2u * PRIORITIES]; // pixels by priority, then of the new ones; starts as zeros
    float scale;
    float planned; // samples, in expectation
};

uint priority_entry(float p, bool is_new)
{
    float step = round(STEPS * log2(max(p, 1e-30))) + 0.5 * float(PRIORITIES);
    return 1u + uint(clamp(step, 0.0, float(PRIORITIES - 1u))) + (is_new ? PRIORITY_NEW : 0u);
}

float priority_value(uint priority) { return exp2((float(priority) - 0.5 * float(PRIORITIES)) / STEPS); }

// Samples in expectation. Old pixels get a quarter of a uniform share at least, so that none misses a change for long.
float budget_samples(uint entry, float scale, float budget, float most)
{
    float least = (entry - 1u & PRIORITY_NEW) != 0u ? 1.0 : 0.25 * min(budget, 1.0);
    return clamp(scale * priority_value(entry - 1u & PRIORITIES - 1u), least, most);
}

#endif
