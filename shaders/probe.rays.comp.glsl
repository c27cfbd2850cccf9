// Sums all VPLs at a probe's pixel, and makes rays towards some, chosen in proportion to the light that they would bring:
// PROBE_RAYS / 4 for each of two independent estimates of each half of the light paths. One workgroup a probe.
//
// Of all VPLs whose slots leave the same rest when divided by the size of the group, one invocation knows the sum: so a
// choice first finds the invocation in the inclusive sums, then walks along its VPLs. u is stratified over the choices.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_ORIGINS_BINDING 4
#include "lgh_shade.glsl.h"
#include "rays.glsl.h"

const uint GROUP = 256u;
const uint CHOICES = PROBE_RAYS / 4u; // of an estimate in a half
layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1) uniform sampler2D depth_map;
layout(set = 0, binding = 2) uniform sampler2D normal_map;
layout(set = 0, binding = 3, scalar) writeonly buffer probes_block { probe probes[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer estimates_block { vec3 estimates[]; };
layout(push_constant, scalar) uniform push_block {
    uint slots, second_half; // slots from second_half on are of the second half of the paths,
    uint lights;             // and those from `lights` on are lights, of which each half has half
    uint first;              // index of the first probe in the sequence of pixels
    float singularity;       // b, metres
} push;

shared float sums[2][GROUP]; // luminance of a half; then inclusive over the invocations
shared vec3 colors[GROUP];

vec3 slot_light(uint slot, gbuffer_point p)
{
    vpl light = vpls[slot];
    return light.intensity > 0.0 ? vpl_light(light, p, push.singularity) : vec3(0.0);
}

// How much of a slot's light belongs to a half.
float half_share(uint slot, uint which)
{
    return slot >= push.lights ? 0.5 : (slot < push.second_half) == (which == 0u) ? 1.0 : 0.0;
}

// Pixels by the R2 sequence (Roberts 2018), whose every stretch is spread evenly over the picture.
uvec2 pixel_of(uint index)
{
    vec2 u = vec2(unit_float(0x80000000u + index * 0xc13fa9a9u), unit_float(0x80000000u + index * 0x91e10da5u));
    return min(uvec2(u * vec2(frame.width, frame.height)), uvec2(frame.width, frame.height) - 1u);
}

void sum_own(uint self, gbuffer_point p)
{
    vec3 color = vec3(0.0);
    float halves[2] = float[](0.0, 0.0);
    for (uint slot = self; slot < push.slots; slot += GROUP) {
        vec3 light = slot_light(slot, p);
        color += light;
        for (uint which = 0u; which < 2u; which++)
            halves[which] += half_share(slot, which) * luminance(light);
    }
    colors[self] = color;
    sums[0][self] = halves[0];
    sums[1][self] = halves[1];
}

void accumulate(uint self)
{
    if (self < 2u)
        for (uint i = 1u; i < GROUP; i++)
            sums[self][i] += sums[self][i - 1u];
    if (self == 2u)
        for (uint i = 1u; i < GROUP; i++)
            colors[0] += colors[i];
}

// First invocation whose inclusive sum exceeds `target`.
uint invocation_at(uint which, float target)
{
    uint low = 0u, high = GROUP - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (target < sums[which][middle])
            high = middle;
        else
            low = middle + 1u;
    }
    return low;
}

// The slot at which the half's running sum exceeds `target`; where rounding leaves none, the last with light.
uint slot_at(uint which, float target, gbuffer_point p)
{
    uint lane = invocation_at(which, target), chosen = 0u;
    float rest = target - (lane > 0u ? sums[which][lane - 1u] : 0.0);
    for (uint slot = lane; slot < push.slots; slot += GROUP) {
        float light = half_share(slot, which) * luminance(slot_light(slot, p));
        if (light <= 0.0)
            continue;
        chosen = slot;
        rest -= light;
        if (rest < 0.0)
            break;
    }
    return chosen;
}

void ray_choose(uint self, uint ray, gbuffer_point p)
{
    uint block = self / CHOICES, which = block & 1u, choice = self % CHOICES;
    float total = sums[which][GROUP - 1u];
    uint bits = hash(push.first + gl_WorkGroupID.x, block, choice, frame.seed);
    uint slot = slot_at(which, total * (float(choice) + unit_float(bits)) / float(CHOICES), p);
    vec3 light = slot_light(slot, p);
    if (total <= 0.0 || luminance(light) <= 0.0)
        return;
    ray_write_to(ray, offset_origin(p.position, p.geometric, frame.scene_radius), vpls[slot].position);
    estimates[ray] = light * (total / (luminance(light) * float(CHOICES)));
}

void main()
{
    uint self = gl_LocalInvocationID.x, index = gl_WorkGroupID.x, ray = index * PROBE_RAYS + self;
    uvec2 pixel = pixel_of(push.first + index);
    gbuffer_point p;
    bool drawn = gbuffer_read(depth_map, normal_map, pixel, p);
    colors[self] = vec3(0.0);
    sums[0][self] = sums[1][self] = 0.0;
    if (drawn)
        sum_own(self, p);
    barrier();
    accumulate(self);
    barrier();
    if (self < PROBE_RAYS) {
        ray_write_none(ray);
        estimates[ray] = vec3(0.0);
        if (drawn)
            ray_choose(self, ray, p);
    }
    if (self == 0u) {
        probes[index].x = pixel.x;
        probes[index].y = pixel.y;
        probes[index].drawn = uint(drawn);
        probes[index].unshadowed = colors[0];
    }
}
