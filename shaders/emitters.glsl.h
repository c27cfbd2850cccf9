// Choosing points on the emissive triangles, and the probability of the choice.
#ifndef EMITTERS_GLSL_H
#define EMITTERS_GLSL_H

#include "scene.glsl.h"

// Below this share of the distribution its floats no longer tell the triangles apart.
const float EMITTER_SHARE_MIN = 0.01;

// The emissive triangles' part of the light sources' distribution; the punctual lights come first in it.
float emitter_share() { return 1.0 - (frame.light_count > 0u ? light_cdf[frame.light_count - 1u] : 0.0); }

// By the sums themselves, so that it is exactly how often emitter_at chooses the triangle.
float emitter_probability(uint triangle, float share)
{
    if (share < EMITTER_SHARE_MIN)
        return 1.0 / float(frame.emitter_count);
    uint source = frame.light_count + triangle;
    float difference = light_cdf[source] - (source > 0u ? light_cdf[source - 1u] : 0.0);
    return max(difference, 1.0 / 16777216.0) / share; // no less than a step of the random numbers
}

// Chooses an emissive triangle by u in [0,1): by power, or uniformly where so little of the distribution is theirs (beside
// a sun) that its floats no longer tell them apart. Writes the probability of the choice.
uint emitter_at(float u, float share, out float probability)
{
    if (share < EMITTER_SHARE_MIN) {
        uint triangle = min(uint(u * float(frame.emitter_count)), frame.emitter_count - 1u);
        probability = emitter_probability(triangle, share);
        return triangle;
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
    probability = emitter_probability(low, share);
    return low;
}

// Uniform on the triangle.
vec2 triangle_point(vec2 u)
{
    float root = sqrt(u.x);
    return vec2(root * (1.0 - u.y), root * u.y);
}

// Index of the emissive triangle that a ray hit; frame.emitter_count where it is none.
uint emitter_find(surface_hit hit)
{
    uint low = 0u, high = frame.emitter_count;
    while (low < high) {
        uint middle = (low + high) / 2u;
        emissive_triangle e = emitters[middle];
        bool is_before = e.instance != hit.instance   ? e.instance < hit.instance
                         : e.geometry != hit.geometry ? e.geometry < hit.geometry
                                                      : e.triangle < hit.triangle;
        low = is_before ? middle + 1u : low;
        high = is_before ? high : middle;
    }
    if (low == frame.emitter_count)
        return low;
    emissive_triangle e = emitters[low];
    bool is_it = e.instance == hit.instance && e.geometry == hit.geometry && e.triangle == hit.triangle;
    return is_it ? low : frame.emitter_count;
}

#endif
