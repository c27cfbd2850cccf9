// Shadow samples of the last frame that are traced again in this one, with its light and geometry: where the answer
// differs, the history does not hold (Schied et al. 2018, "Gradient Estimation for Real-Time Adaptive Temporal
// Filtering"). One pixel in each stratum of 4 x 4 keeps its first sample. See modules/shadow_again.h.
#ifndef SHADOW_AGAIN_GLSL_H
#define SHADOW_AGAIN_GLSL_H

#include "scene.glsl.h"

const uint AGAIN_SIDE = 4u; // as in modules/shadow_again.c

struct shadow_record {
    vec3 position; // of the surface point, world
    uint slot;     // of the VPL at the ray's end, or LGH_NO_SAMPLE
    vec4 normals;  // as in the G-buffer
    vec3 end;      // world
    float light;   // luminance that the VPL sends to the point, or 1 without one; 0: no sample
    float weight;  // times `light`: what the sample adds to U
    uint identity; // of the instance: see world_identity
    uint visible;
};

// How far the filter's history of the ratio lags behind a stratum's samples, over the last few frames: what they add to
// S beyond their U times the history's ratio. Without a lag these are innovations of a mean, which do not correlate.
struct shadow_lag {
    vec2 now;     // sums of U and S in this frame alone
    float light;  // sum of U
    float lag;    // sum of S - ratio * U
    vec2 squares; // variance of `lag`: as found, and as the ratio lets expect, where few samples tell
};

uvec2 again_size() { return (uvec2(frame.width, frame.height) + AGAIN_SIDE - 1u) / AGAIN_SIDE; }
uvec2 again_stratum(uvec2 pixel) { return pixel / AGAIN_SIDE; }
uint again_index(uvec2 stratum) { return stratum.y * again_size().x + stratum.x; }

// The pixel of a stratum that keeps its sample in this frame.
uvec2 again_pixel(uvec2 stratum)
{
    uint random = hash(again_index(stratum), frame.frame, frame.seed);
    uvec2 pixel = stratum * AGAIN_SIDE + uvec2(random, random >> 16) % AGAIN_SIDE;
    return min(pixel, uvec2(frame.width, frame.height) - 1u);
}

// Frames that the history at a place in the last frame, in pixels, may count.
float again_limit(sampler2D limits, vec2 place)
{
    ivec2 stratum = ivec2(floor(place + 0.5)) / int(AGAIN_SIDE);
    return texelFetch(limits, clamp(stratum, ivec2(0), textureSize(limits, 0) - 1), 0).x;
}

#endif
