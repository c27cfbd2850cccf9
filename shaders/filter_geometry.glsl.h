// Edge stopping by geometry, shared by all filters over pixels. They read `filter_geometry`, one RGBA32F texel a pixel
// (shading normal, view depth; 0 where nothing was drawn): one image load a tap instead of two fetches and two decodes.
#ifndef FILTER_GEOMETRY_GLSL_H
#define FILTER_GEOMETRY_GLSL_H

#include "gbuffer.glsl.h"

// The pixel that is filtered.
struct filter_center {
    vec3 shading;
    // A tap's distance from the tangent plane is view_z * (plane.x * tap.x + plane.y * tap.y + plane.z) - plane.w, in units
    // in which the weight is exp2(-distance^2).
    vec4 plane;
};

// Metres that a pixel covers, seen face on, at a view depth.
float pixel_footprint(float view_z) { return 2.0 * view_z * length(frame.up) / float(frame.height); }

filter_center filter_center_of(ivec2 pixel, vec4 geometry, vec3 geometric)
{
    // Two footprints weigh 1/e: above the rounding of the depth buffer, below what one sees as a step.
    const float SQRT_LOG2_E = 1.2011224;
    float scale = 0.5 * SQRT_LOG2_E / pixel_footprint(geometry.w);
    vec2 size = vec2(frame.width, frame.height);
    // Along the normal, over the view depth: a pixel's position relative to the eye is
    // view_z * (forward + ndc.x * right - ndc.y * up), ndc = (pixel + 0.5) / size * 2 - 1.
    vec2 across = scale * vec2(dot(geometric, frame.right), -dot(geometric, frame.up));
    vec3 plane = vec3(2.0 * across / size, scale * dot(geometric, frame.forward) + dot(across, 1.0 / size - 1.0));
    return filter_center(geometry.xyz, vec4(plane, geometry.w * dot(plane, vec3(pixel, 1.0))));
}

// In [0,1]; 0 where nothing was drawn. The exponent is 64 (SVGF uses 128, too strict for normal maps at one frame's noise).
float filter_normal_weight(filter_center center, vec4 geometry)
{
    float cosine = geometry.w > 0.0 ? max(dot(center.shading, geometry.xyz), 0.0) : 0.0;
    float power2 = cosine * cosine, power4 = power2 * power2, power8 = power4 * power4;
    float power16 = power8 * power8, power32 = power16 * power16;
    return power32 * power32;
}

// The square of the tap's distance from the tangent plane; exp2 of its negative is the weight.
float filter_plane_distance2(filter_center center, ivec2 tap, vec4 geometry)
{
    float distance = geometry.w * dot(center.plane.xyz, vec3(tap, 1.0)) - center.plane.w;
    return distance * distance;
}

// In [0,1]: whether the tap lies on the center's surface.
float filter_geometry_weight(filter_center center, ivec2 tap, vec4 geometry)
{
    return filter_normal_weight(center, geometry) * exp2(-filter_plane_distance2(center, tap, geometry));
}

#endif
