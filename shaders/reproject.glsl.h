// Finding a pixel's surface in the last frame: four bilinear taps, each refused where it shows another surface. Its
// images are bound from REPROJECT_BINDING on (default 0), in the order of reproject_declare (modules/filters.h).
#ifndef REPROJECT_GLSL_H
#define REPROJECT_GLSL_H

#include "filter_geometry.glsl.h"

#ifndef REPROJECT_BINDING
#define REPROJECT_BINDING 0
#endif
layout(set = 0, binding = REPROJECT_BINDING) uniform sampler2D depth_map;
layout(set = 0, binding = REPROJECT_BINDING + 1) uniform sampler2D normal_map;
layout(set = 0, binding = REPROJECT_BINDING + 2) uniform sampler2D motion_map;
layout(set = 0, binding = REPROJECT_BINDING + 3) uniform sampler2D albedo_map;
layout(set = 0, binding = REPROJECT_BINDING + 4) uniform sampler2D previous_depth;
layout(set = 0, binding = REPROJECT_BINDING + 5) uniform sampler2D previous_normals;
layout(set = 0, binding = REPROJECT_BINDING + 6) uniform sampler2D previous_albedo;

struct reprojection {
    ivec2 corner; // taps: corner + (0,0), (1,0), (0,1), (1,1)
    vec4 weights; // of the taps; sum 1
};

ivec2 reprojection_tap(reprojection r, int i) { return r.corner + ivec2(i & 1, i >> 1); }

vec3 previous_position(ivec2 pixel, float depth)
{
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(frame.width, frame.height) * 2.0 - 1.0;
    vec3 ray = frame.previous_forward + ndc.x * frame.previous_right - ndc.y * frame.previous_up;
    return frame.previous_eye + frame.near_plane / depth * ray;
}

// Pixels that the surface itself moved, beyond what the camera's motion explains.
float object_motion(vec3 position, vec2 place)
{
    vec4 clip = frame.previous_view_projection * vec4(position, 1.0);
    if (clip.w <= 0.0)
        return 0.0;
    vec2 previous = (clip.xy / clip.w * 0.5 + 0.5) * vec2(frame.width, frame.height);
    return length(previous - (place + 0.5));
}

// A pixel's place in the last frame.
vec2 reprojection_place(uvec2 pixel) { return vec2(pixel) + texelFetch(motion_map, ivec2(pixel), 0).xy; }

// What a pixel's surface is known by in the last frame.
struct reprojection_surface {
    vec3 position, normal; // geometric
    float identity;
    float tolerance; // metres off its plane
};

bool shows_surface(ivec2 tap, reprojection_surface s)
{
    if (any(greaterThanEqual(uvec2(tap), uvec2(frame.width, frame.height))))
        return false;
    float depth = texelFetch(previous_depth, tap, 0).x;
    return depth > 0.0 && texelFetch(previous_albedo, tap, 0).a == s.identity &&
           dot(octahedral_decode(texelFetch(previous_normals, tap, 0).xy), s.normal) >= 0.9 &&
           abs(dot(s.normal, previous_position(tap, depth) - s.position)) <= s.tolerance;
}

// The nearest pixel around that showed the surface: what comes into sight at the rim of a surface has its history there
// (Schied et al. 2017, section 4.1). False: there is none.
bool reproject_nearest(vec2 place, reprojection_surface s, out reprojection r)
{
    vec2 size = vec2(frame.width, frame.height);
    if (any(lessThan(place, vec2(-0.5))) || any(greaterThan(place, size - 0.5)))
        return false; // came into the picture
    float nearest = 1e30;
    for (int i = 0; i < 9; i++) {
        ivec2 tap = ivec2(round(place)) + ivec2(i % 3, i / 3) - 1;
        float distance = dot(vec2(tap) - place, vec2(tap) - place);
        if (distance < nearest && shows_surface(tap, s)) {
            nearest = distance;
            r = reprojection(tap, vec4(1.0, 0.0, 0.0, 0.0));
        }
    }
    return nearest < 1e30;
}

// False where the last frame did not show the surface.
bool reproject(uvec2 pixel, gbuffer_point point, out reprojection r)
{
    vec2 place = reprojection_place(pixel);
    // An object that moved sideways by some pixels may have moved as far along its normal.
    float moved = object_motion(point.position, place);
    float tolerance = pixel_footprint(point.view_z) * (2.0 + (moved > 0.1 ? 2.0 * moved : 0.0));
    reprojection_surface s =
        reprojection_surface(point.position, point.geometric, texelFetch(albedo_map, ivec2(pixel), 0).a, tolerance);
    r.corner = ivec2(floor(place));
    vec2 f = place - vec2(r.corner);
    r.weights = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
    for (int i = 0; i < 4; i++)
        if (r.weights[i] > 0.0 && !shows_surface(reprojection_tap(r, i), s))
            r.weights[i] = 0.0;
    float total = dot(r.weights, vec4(1.0));
    // Below a hundredth the history would be one badly placed texel.
    if (total < 0.01)
        return reproject_nearest(place, s, r);
    r.weights /= total;
    return true;
}

#endif
