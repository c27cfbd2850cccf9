// What a grid light or a VPL sends to a shaded point: blending functions, emission models, one formula for both. Used by
// the light volumes, the shadow rays and the brute-force tests alike, so that they agree by construction.
#ifndef LGH_SHADE_GLSL_H
#define LGH_SHADE_GLSL_H

#include "gbuffer.glsl.h"
#include "lgh.glsl.h"

const uint BLEND_LOWEST = 0u; // the lowest level in use
const uint BLEND_MIDDLE = 1u;
const uint BLEND_TOP = 2u;
const uint BLEND_ONLY = 3u;   // one level alone

// Where a level begins to give way to the next, in r: from there its share falls to 0 at 2 r. 1 is the papers' (Lin and
// Yuksel 2019, Figure 2; Yuksel and Yuksel 2017). Later, the coarse lights, which are wrong nearby, come in only farther
// away, and no light reaches farther: measured, relative L2 at equal lights per pixel, start level 0, in the atrium,
// Sponza and the kitchen .226, .122 and .175 with 1, .187, .112 and .161 with 1.5. Beyond 1.6 Sponza gets
// worse. The levels then agree less on what each leaves to the next: an empty room loses 1.8 % of its light, not 0.2 %.
// A shader that offers the choice (--blend) defines LGH_BLEND_CONSTANT as the number of a free specialization constant:
// 1 for the papers' way.
#ifdef LGH_BLEND_CONSTANT
layout(constant_id = LGH_BLEND_CONSTANT) const bool PAPER_BLEND = false;
#else
const bool PAPER_BLEND = false;
#endif
const float BLEND_START = PAPER_BLEND ? 1.0 : 1.5;

// The share of a level at distance d, r = alpha * h. For one d over all levels these sum to 1.
float lgh_blend(uint kind, float d, float r)
{
    float rise = clamp((2.0 * d / r - BLEND_START) / (2.0 - BLEND_START), 0.0, 1.0);
    float fall = clamp((2.0 - d / r) / (2.0 - BLEND_START), 0.0, 1.0);
    return kind == BLEND_LOWEST ? fall : kind == BLEND_MIDDLE ? min(rise, fall) : kind == BLEND_TOP ? rise : 1.0;
}

// Kind of exponent c's level. `lowest` is the exponent of the lowest level in use: level_count - 1 for S1, or
// level_count for the VPLs themselves (start level 0).
uint blend_kind(uint c, uint lowest)
{
    if (lowest == 0u)
        return BLEND_ONLY;
    return c == lowest ? BLEND_LOWEST : c == 0u ? BLEND_TOP : BLEND_MIDDLE;
}

// ---- Lights that radiate evenly: point lights among the VPLs, of normal 0 (vpl_trace_lights.glsl.h). With colour 4 I they
// send a quarter of it in every direction. They add nothing to the moments of the normals, so that the trace of M, which
// is 1 for VPLs of surfaces alone, tells which share of a grid light's flux is the surfaces'.

const float EVEN_EMISSION = 0.25;
// To a point that such a light nearly touches it is no nearer than this, in scene radii: it has no b that would bound it.
const float EVEN_NEAR = 3e-4;

// The surfaces' share; exactly 1 where there is nothing else, up to which rounding is taken for nothing.
float surface_share(vec3 moment_diagonal)
{
    float share = moment_diagonal.x + moment_diagonal.y + moment_diagonal.z;
    return share > 0.999 ? 1.0 : share;
}
float surface_share(vpl light) { return light.normal == vec3(0.0) ? 0.0 : 1.0; }

// b^2 of a light: real lights have none.
float square_singularity(float singularity, float share) { return singularity * singularity * share; }

float even_near() { return EVEN_NEAR * EVEN_NEAR * frame.scene_radius * frame.scene_radius; }

// ---- What a light sends

// What a grid light's VPLs send towards the unit direction v, relative to their intensity: an estimate of the mean over
// their normals n of max(0, n.v), from the mean normal m and the second moment M. `share` is the surfaces'.
float grid_emission(uint model, grid_light light, float share, vec3 v)
{
    float even = EVEN_EMISSION * (1.0 - share);
    float mean = dot(light.normal, v);
    float square = max(0.0, dot(light.moment_diagonal, v * v) + 2.0 * dot(light.moment_mixed, v.xxy * v.yzz)); // v' M v
    if (model <= EMISSION_MEAN_NORMAL)
        return max(0.0, mean) + even;
    // A: the clamped cosine's expansion to second order in spherical harmonics, averaged (Ramamoorthi and Hanrahan 2001).
    float a = max(0.0, 0.25 + 0.5 * mean + 5.0 / 32.0 * (3.0 * square - share));
    // B: max(0, x) = (x + |x|) / 2 with E|x| <= sqrt(E x^2).
    float b = max(0.0, 0.5 * (mean + sqrt(share * square))) + even;
    return model == EMISSION_A ? a : model == EMISSION_B ? b : 0.5 * (a + b);
}

// A grid light is no nearer than its own spread, the square of its VPLs' standard deviation, in the models A, B and AB.
// Without it the one point in their midst glares where they would light the surface evenly: measured, relative L2 in
// the atrium at alpha 1 and 2, 0.28 and 0.20 without, 0.23 and 0.14 with. The authors' models go without.
float grid_spread(uint model, grid_light light)
{
    return model <= EMISSION_MEAN_NORMAL ? 0.0 : dot(light.deviation, light.deviation);
}

// Radiance over albedo that a unit of light from `position` gives a surface point before the emission factor:
// cos / (pi (d^2 + b^2)), where d^2 is at least `nearest`; zero from behind either normal. `to_point` becomes the unit
// direction from light to point.
float receive(vec3 position, float nearest, gbuffer_point p, float square_b, out vec3 to_point)
{
    vec3 offset = p.position - position;
    float square = dot(offset, offset);
    to_point = offset * inversesqrt(max(square, 1e-20));
    if (dot(p.geometric, to_point) >= 0.0)
        return 0.0;
    return max(0.0, -dot(p.shading, to_point)) / (PI * (max(square, nearest) + square_b + 1e-20));
}

// What a grid light sends to a surface point, radiance over albedo.
vec3 grid_light_sent(grid_light light, vec3 position, uint model, gbuffer_point p, float singularity)
{
    vec3 v;
    float share = surface_share(light.moment_diagonal);
    float received = receive(position, grid_spread(model, light), p, square_singularity(singularity, share), v);
    return light.color * (received * grid_emission(model, light, share, v));
}

// The same of a light that is no nearer than the root of `nearest`.
vec3 vpl_light_from(vpl light, float nearest, gbuffer_point p, float singularity)
{
    vec3 v;
    float share = surface_share(light);
    float received = receive(light.position, nearest, p, square_singularity(singularity, share), v);
    return light.color * (received * (max(0.0, dot(light.normal, v)) + EVEN_EMISSION * (1.0 - share)));
}

vec3 vpl_light(vpl light, gbuffer_point p, float singularity)
{
    return vpl_light_from(light, surface_share(light) == 0.0 ? even_near() : 0.0, p, singularity);
}

#endif
