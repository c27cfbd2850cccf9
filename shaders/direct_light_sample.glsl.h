// Sampled direct light: shadow rays, each with the light that it stands for. Their sum and that of the visible ones are a
// pair of estimates that differ by visibility alone. Many punctual lights are sampled by streaming over all of them,
// emissive triangles by resampled importance sampling (Talbot et al. 2005). The including shader defines ANALYTIC: 1 also
// writes the unshadowed light exactly.
#define RAYS_BINDING 2
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 3
#include "light_rays.glsl.h"
#include "direct_light.glsl.h"
#include "emitters.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 6, rgba32f) uniform image2D direct_u;
#if ANALYTIC
layout(set = 0, binding = 7, rgba32f) uniform writeonly image2D direct_analytic;
#endif
// The rays' layers: `samples` of the punctual lights, where they are sampled here, then `samples` of the emissive
// triangles, where there are any.
layout(push_constant, scalar) uniform push_block {
    uint first, layers; // of this batch
    uint samples;       // of each kind, 1 to DIRECT_SAMPLES_MAX
    uint candidates;    // of each sample of the emissive triangles
    uint punctual;      // punctual lights that are sampled here, the first ones; 0: none is
} push;

struct direct_estimate {
    vec3 unshadowed;
    vec3 exact; // the same without noise
    uint rays;
};

uint ray_of_layer(uvec2 pixel, uint layer) { return light_ray_index(pixel, layer - push.first); }

void make_ray(uint index, vec3 light, vec3 origin, vec3 direction, float distance, inout direct_estimate estimate)
{
    light /= float(push.samples);
    estimate.unshadowed += light;
    estimate.rays++;
    light_ray_write(index, origin, direction, distance, light);
}

// Reservoirs of size one: a light replaces the kept one with its share of the weights so far. The random numbers are
// keyed by light and sample, not drawn in turn.
void sample_punctual(uvec2 pixel, gbuffer_point point, vec3 origin, uint key, inout direct_estimate estimate)
{
    uint chosen[DIRECT_SAMPLES_MAX];
    uint end = min(push.first + push.layers, push.samples);
    float total = 0.0;
    for (uint i = 0u; i < push.punctual; i++) {
        vec3 light = punctual_arrival(lights[i], point).light;
        float weight = luminance(light);
        if (weight <= 0.0)
            continue;
        estimate.exact += light;
        total += weight;
        uint light_key = hash(key, i);
        for (uint s = push.first; s < end; s++)
            if (total == weight || unit_float(hash(light_key, s)) * total < weight)
                chosen[s] = i;
    }
    for (uint s = push.first; s < end; s++) {
        uint ray = ray_of_layer(pixel, s);
        if (total <= 0.0) {
            light_ray_write_none(ray);
            continue;
        }
        light_arrival a = punctual_arrival(lights[chosen[s]], point);
        make_ray(ray, a.light * (total / luminance(a.light)), origin, a.direction, 0.9999 * a.distance, estimate);
    }
}

struct emitter_choice {
    uint triangle;
    vec2 barycentrics;
    vec3 light;   // the estimate of all the emitters' unshadowed light that it stands for
};

// One point out of push.candidates, in proportion to the luminance it sends. The triangles are chosen by power,
// stratified; their points lie on an R2 sequence (Roberts 2018) with a random shift.
emitter_choice emitter_choose(gbuffer_point point, uint key, float share)
{
    const vec2 r2 = vec2(0.7548776662, 0.5698402910);
    vec2 shift = vec2(unit_float(hash(key, 1u)), unit_float(hash(key, 2u)));
    emitter_choice choice = emitter_choice(0u, vec2(0.0), vec3(0.0));
    float total = 0.0, chosen_weight = 1.0;
    for (uint i = 0u; i < push.candidates; i++) {
        uint candidate_key = hash(key, 3u + i);
        float probability;
        uint triangle =
            emitter_at((float(i) + unit_float(candidate_key)) / float(push.candidates), share, probability);
        vec2 barycentrics = triangle_point(fract(shift + float(i) * r2));
        emissive_triangle e = emitters[triangle];
        vec3 light = emitter_light(e, barycentrics, point) * (e.area / probability);
        float weight = luminance(light);
        total += weight;
        if (weight > 0.0 && unit_float(hash(candidate_key)) * total < weight) {
            choice = emitter_choice(triangle, barycentrics, light);
            chosen_weight = weight;
        }
    }
    choice.light *= total / (chosen_weight * float(push.candidates));
    return choice;
}

void sample_emitters(uvec2 pixel, gbuffer_point point, vec3 origin, uint key, inout direct_estimate estimate)
{
    float share = emitter_share();
    uint before = push.punctual > 0u ? push.samples : 0u;
    for (uint layer = max(push.first, before); layer < push.first + push.layers; layer++) {
        uint ray = ray_of_layer(pixel, layer);
        emitter_choice choice = emitter_choose(point, hash(key, layer - before), share);
        if (choice.light == vec3(0.0)) {
            light_ray_write_none(ray);
            continue;
        }
        emissive_triangle e = emitters[choice.triangle];
        vec3 end = e.corner + choice.barycentrics.x * e.edge1 + choice.barycentrics.y * e.edge2;
        // Off the emitter's plane on the lit side, so that the ray cannot hit the emitter itself.
        vec3 side = dot(e.normal, point.position - e.corner) > 0.0 ? e.normal : -e.normal;
        vec3 path = offset_origin(end, side, frame.scene_radius) - origin;
        float distance = max(length(path), 1e-12);
        make_ray(ray, choice.light, origin, path / distance, distance, estimate);
    }
}

void make_rays(uvec2 pixel, gbuffer_point point, inout direct_estimate estimate)
{
    vec3 origin = offset_origin(point.position, point.geometric, frame.scene_radius);
    uint key = hash(pixel.x | pixel.y << 16, frame.frame, frame.seed);
    if (push.punctual > 0u && push.first < push.samples)
        sample_punctual(pixel, point, origin, hash(key, 1u), estimate);
    if (frame.emitter_count > 0u)
        sample_emitters(pixel, point, origin, hash(key, 2u), estimate);
#if ANALYTIC
    for (uint i = 0u; i < frame.emitter_count; i++)
        estimate.exact += emitter_light_exact(emitters[i], point);
#endif
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    direct_estimate estimate = direct_estimate(vec3(0.0), vec3(0.0), 0u);
    if (all(lessThan(pixel, uvec2(frame.width, frame.height)))) {
        if (push.first > 0u)
            estimate.unshadowed = imageLoad(direct_u, ivec2(pixel)).rgb;
        gbuffer_point point;
        if (gbuffer_read(depth_map, normal_map, pixel, point))
            make_rays(pixel, point, estimate);
        else
            for (uint i = 0u; i < push.layers; i++)
                light_ray_write_none(light_ray_index(pixel, i));
        imageStore(direct_u, ivec2(pixel), vec4(estimate.unshadowed, 0.0));
#if ANALYTIC
        imageStore(direct_analytic, ivec2(pixel), vec4(estimate.exact, 0.0));
#endif
    }
    ray_count(estimate.rays);
}
