// Makes the shadow rays: for each pixel and reservoir one towards a point of the chosen light, with the estimate of the
// light that it stands for. U is the sum of the estimates, S that of the visible ones (modules/light_rays.h), so S / U is
// the shadow ratio (Heitz et al. 2018; Lin and Yuksel 2019, section 3.3).
#ifndef SHADOW_GLSL_H
#define SHADOW_GLSL_H

#define RAYS_BINDING 0
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 8
#include "light_rays.glsl.h"
#include "gbuffer.glsl.h"
#include "interleave.glsl.h"
#define LGH_BLEND_CONSTANT 3
#include "lgh_shade.glsl.h"
#include "reservoir.glsl.h"
#include "shadow_again.glsl.h"
#include "shadow_budget.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer grid_lights_block { grid_light grid_lights[]; };
layout(set = 0, binding = 3, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 4) uniform sampler2D depth_map;
layout(set = 0, binding = 5) uniform sampler2D normal_map;
layout(set = 0, binding = 6) uniform sampler2D indirect_map;
layout(set = 0, binding = 7, scalar) readonly buffer keys_block { uint64_t reservoir_keys[]; };
layout(set = 0, binding = 7, scalar) readonly buffer words_block { uint reservoir_words[]; };
layout(set = 0, binding = 11, rgba32f) uniform image2D shadow_u;
layout(set = 0, binding = 12, scalar) readonly buffer budget_block { budget_header budget; };
layout(set = 0, binding = 13, scalar) readonly buffer plan_block { uint plan[]; };
layout(set = 0, binding = 14, scalar) writeonly buffer records_block { shadow_record records[]; };
#ifdef END_POINT_VPL
layout(set = 0, binding = 15, scalar) readonly buffer samples_block { uvec4 samples[]; };
#endif
layout(push_constant, scalar) uniform push_block {
    uint interleave, emission, start_level, samples;
    uint first, layers; // samples of this batch
    float singularity;  // b, metres
    float ray_budget;   // rays a pixel
} push;

layout(constant_id = 0) const bool EXACT = true;
layout(constant_id = 1) const bool UNIFORM = false;
layout(constant_id = 2) const bool JITTER = false; // end points of shadow.comp.glsl: jittered, else centres
layout(constant_id = 4) const bool BUDGET = false; // else all samples, and budget and plan are not read

#include "shadow_end_point.glsl.h"

uint reservoir_light(uint pixel, uint s)
{
    return EXACT ? uint(reservoir_keys[pixel * push.samples + s])
                 : reservoir_words[pixel * (push.samples + 1u) + 1u + s];
}

// The light of a sample as the light volumes saw it: what it sends to the point, blended and dealt, and what its end
// point would have sent in its place.
struct shadow_sample {
    vec3 centre_light; // decides the weight f
    vec3 end_light;    // what U uses
    vec3 end;
    uint slot;         // of the VPL at the end, or LGH_NO_SAMPLE
};

float dealt_factor(uint count)
{
    uint tiles = push.interleave * push.interleave;
    return count >= 4u * tiles ? float(tiles) : 1.0;
}

shadow_sample vpl_sample(uint slot, gbuffer_point p)
{
    vpl light = vpls[slot];
    float r = 0.5 * header.levels[header.level_count - 1u].radius;
    float scale = float(push.interleave * push.interleave);
    scale *= lgh_blend(BLEND_LOWEST, distance(light.position, p.position), r);
    vec3 sent = scale * vpl_light(light, p, push.singularity);
    return shadow_sample(sent, sent, light.position, slot);
}

shadow_sample grid_sample(uint index, gbuffer_point p, uint random)
{
    grid_light light = grid_lights[index];
    uint c = light_exponent(header, index);
    uint lowest = push.start_level == 0u ? header.level_count : header.level_count - 1u;
    uint kind = blend_kind(c, lowest);
    float radius = header.levels[c].radius, dealt = dealt_factor(header.levels[c].occupied);
    float blend = lgh_blend(kind, distance(light.position, p.position), radius);
    vec3 sent = grid_light_sent(light, light.position, push.emission, p, push.singularity);
    shadow_sample s;
    s.centre_light = dealt * blend * sent;
    s.end_light = end_point_light(light, index, c, sent, p, random, s.end, s.slot);
    // The centres' shares count what is near twice, in the level below and under centres that lie farther away (a light
    // half a metre from a wall under lanterns 2.2 times, one at 12 m 0.9 times), and what is near is seen more often. The
    // end points' own shares do not, but rare samples would weigh without bound; the variance of the mean is bounded.
    s.end_light *= dealt * sqrt(blend * lgh_blend(kind, distance(s.end, p.position), radius));
    return s;
}

// How many of its samples a pixel with light uses in this frame. The expectation is rounded up or down by a threshold
// that goes over [0,1) evenly from frame to frame, so that what is spent in vain in one is spent in the next.
uint samples_used(uint index)
{
    if (!BUDGET)
        return push.samples;
    uint entry = plan[index];
    if (entry == 0u)
        return 0u;
    float threshold = fract(unit_float(hash(index, frame.seed, 0x2c1b3c6du)) + float(frame.frame & 0xfffu) * 0.61803399);
    return min(uint(budget_samples(entry, budget.scale, push.ray_budget, float(push.samples)) + threshold),
               push.samples);
}

// The part of the pixel's light that one of `used` samples stands for; black: it has none. `slot` as in shadow_sample.
vec3 sample_estimate(uint light, float f_sum, uint used, gbuffer_point p, uint random, out vec3 end, out uint slot)
{
    end = p.position;
    slot = LGH_NO_SAMPLE;
    if (light == RESERVOIR_EMPTY)
        return vec3(0.0);
    bool is_vpl = (light & RESERVOIR_VPL) != 0u;
    shadow_sample chosen = is_vpl ? vpl_sample(light & ~RESERVOIR_VPL, p) : grid_sample(light, p, random);
    end = chosen.end;
    slot = chosen.slot;
    float f = UNIFORM ? 1.0 : luminance(chosen.centre_light);
    return f > 0.0 ? chosen.end_light * (f_sum / (f * float(used))) : vec3(0.0);
}

// A sample to be traced again in the next frame.
shadow_record record_of(float estimate, gbuffer_point p, vec3 end, uint slot)
{
    float light = slot != LGH_NO_SAMPLE ? luminance(vpl_light(vpls[slot], p, push.singularity)) : 1.0;
    shadow_record made;
    made.slot = slot;
    made.end = end;
    made.light = estimate > 0.0 ? light : 0.0;
    made.weight = made.light > 0.0 ? estimate / light : 0.0;
    return made;
}

// Makes the ray of the batch's sample i where it has light, and adds that to U. Returns the number of rays.
uint make_ray(uvec2 pixel, uint i, float f_sum, uint used, gbuffer_point p, inout vec3 u)
{
    uint index = pixel.y * frame.width + pixel.x, s = push.first + i, ray = light_ray_index(pixel, i);
    uint random = hash(hash(index, frame.frame, frame.seed), 0x51ed270bu, s);
    vec3 end;
    uint slot;
    vec3 estimate = sample_estimate(reservoir_light(index, s), f_sum, used, p, random, end, slot);
    if (s == 0u && again_pixel(again_stratum(pixel)) == pixel)
        records[again_index(again_stratum(pixel))] = record_of(luminance(estimate), p, end, slot);
    if (luminance(estimate) <= 0.0) {
        light_ray_write_none(ray);
        return 0u;
    }
    u += estimate;
    light_ray_write_to(ray, offset_origin(p.position, p.geometric, frame.scene_radius), end, estimate);
    return 1u;
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy, size = uvec2(frame.width, frame.height);
    uint rays = 0u;
    if (all(lessThan(pixel, size))) {
        vec3 u = push.first == 0u ? vec3(0.0) : imageLoad(shadow_u, ivec2(pixel)).rgb;
        gbuffer_point point;
        float f_sum = 0.0;
        if (gbuffer_read(depth_map, normal_map, pixel, point))
            f_sum = texelFetch(indirect_map, ivec2(interleave_texel(pixel, push.interleave, size)), 0).a;
        uint used = f_sum > 0.0 ? samples_used(pixel.y * frame.width + pixel.x) : 0u;
        for (uint i = 0u; i < push.layers; i++)
            if (push.first + i < used)
                rays += make_ray(pixel, i, f_sum, used, point, u);
            else
                light_ray_write_none(light_ray_index(pixel, i));
        if (push.first == 0u && used == 0u && again_pixel(again_stratum(pixel)) == pixel)
            records[again_index(again_stratum(pixel))].light = 0.0;
        imageStore(shadow_u, ivec2(pixel), vec4(u, f_sum > 0.0 && used == 0u ? 1.0 : 0.0));
    }
    ray_count(rays);
}

#endif
