// Choosing points on the emissive triangles.
#ifndef EMITTERS_GLSL_H
#define EMITTERS_GLSL_H

#include "scene.glsl.h"

// Below this share of the distribution its floats no longer tell the triangles apart.
const float EMITTER_SHARE_MIN = 0.01;

// The emissive triangles' part of the light sources' distribution; the punctual lights come first in it.
float emitter_share() { return 1.0 - (frame.light_count > 0u ? light_cdf[frame.light_count - 1u] : 0.0); }

// Chooses an emissive triangle by u in [0,1): by power, or uniformly where so little of the distribution is theirs (beside
// a sun) that its floats no longer tell them apart. Writes the probability of the choice.
uint emitter_at(float u, float share, out float probability)
{
    if (share < EMITTER_SHARE_MIN) {
        probability = 1.0 / float(frame.emitter_count);
        return min(uint(u * float(frame.emitter_count)), frame.emitter_count - 1u);
    }
    float target = 1.0 - share + u * share;
    uint low = 0u, high = frame.emitter_count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (light_cdf[frame.light_count + middle] > target)
            high = middle;
        else
            low = middle + 1u;
    }
    probability = max(emitters[low].probability / share, 1e-30);
    return low;
}

// Uniform on the triangle.
vec2 triangle_point(vec2 u)
{
    float root = sqrt(u.x);
    return vec2(root * (1.0 - u.y), root * u.y);
}

#endif
