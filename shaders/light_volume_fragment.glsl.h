// Fragment side of the light volumes: adds a light's blended, unshadowed contribution and offers it to the pixel's shadow
// reservoirs (Lin and Yuksel 2019, sections 3.2 and 3.3).
//
// `exact` reservoirs keep the light with the smallest -log(u) / f, which picks light i with probability f_i / sum f
// whatever the order (Efraimidis and Spirakis 2006), by a 64-bit atomic minimum of (key, light). `unlocked` ones replace
// with probability f / running sum by plain loads and stores, as the paper does without its locks.
#ifndef LIGHT_VOLUME_FRAGMENT_GLSL_H
#define LIGHT_VOLUME_FRAGMENT_GLSL_H

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "light_volume.glsl.h"
#include "gbuffer.glsl.h"
#include "reservoir.glsl.h"

layout(set = 0, binding = 3) uniform sampler2D depth_map;
layout(set = 0, binding = 4) uniform sampler2D normal_map;
layout(set = 0, binding = 5, scalar) buffer keys_block { uint64_t reservoir_keys[]; };
layout(set = 0, binding = 5, scalar) buffer words_block { uint reservoir_words[]; };

layout(constant_id = 0) const bool EXACT = true;
layout(constant_id = 1) const bool UNIFORM = false;

layout(location = 0) out vec4 light_sum; // rgb: radiance over albedo; a: sum of f over the lights that were offered
layout(location = 1) out float light_count;

struct shaded_pixel {
    gbuffer_point point;
    uint index; // of the pixel, for reservoirs
    uint key;   // for random numbers
};

// False where nothing was drawn, and in the padding of a tiled image.
bool read_pixel(out shaded_pixel pixel)
{
    uvec2 size = uvec2(frame.width, frame.height);
    uvec2 p = interleave_pixel(uvec2(gl_FragCoord.xy), push.interleave, size);
    if (any(greaterThanEqual(p, size)) || !gbuffer_read(depth_map, normal_map, p, pixel.point))
        return false;
    pixel.index = p.y * size.x + p.x;
    pixel.key = hash(pixel.index, frame.frame, frame.seed);
    return true;
}

// Offers a light with weight f > 0. Draws with push.sampled = 2 (S1, where it is left out of the sampling) only count
// where no other light was offered; their keys have the top bit set, and their running sums are negative.
// Returns whether the light was offered.
bool offer_exact(shaded_pixel pixel, uint light, uint light_key, float f)
{
    uint late = push.sampled == 2u ? 0x80000000u : 0u;
    uint first = pixel.index * push.samples;
    if (late != 0u && uint(reservoir_keys[first] >> 32) < late)
        return false;
    for (uint s = 0u; s < push.samples; s++) {
        uint64_t key = uint64_t(reservoir_key(hash(light_key, s), f) | late) << 32 | uint64_t(light);
        if (key < reservoir_keys[first + s])
            atomicMin(reservoir_keys[first + s], key);
    }
    return true;
}

bool offer_unlocked(shaded_pixel pixel, uint light, uint light_key, float f)
{
    uint first = pixel.index * (push.samples + 1u);
    float sum = uintBitsToFloat(reservoir_words[first]);
    if (push.sampled == 2u) {
        if (sum > 0.0)
            return false;
        sum -= f;
    } else {
        sum += f;
    }
    reservoir_words[first] = floatBitsToUint(sum);
    for (uint s = 0u; s < push.samples; s++)
        if (unit_float(hash(light_key, s)) * abs(sum) < f)
            reservoir_words[first + 1u + s] = light;
    return true;
}

// Adds what arrives from a light at exponent c; `identity` tells lights apart over frames, `id` names it in reservoirs.
void add_light(shaded_pixel pixel, vec3 light, float blend, uint id, uint identity, uint c)
{
    light *= blend;
    float f = luminance(light);
    if (UNIFORM && f > 0.0)
        f = 1.0;
    light_sum.rgb += light;
    light_count += 1.0;
    if (push.samples == 0u || f <= 0.0)
        return;
    uint light_key = hash(pixel.key, identity, c);
    if (EXACT ? offer_exact(pixel, id, light_key, f) : offer_unlocked(pixel, id, light_key, f))
        light_sum.a += f;
}

#endif
