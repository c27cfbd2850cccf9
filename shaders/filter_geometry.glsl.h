// Edge stopping by geometry, shared by all filters over pixels. They read `filter_geometry`, one RGBA32F texel a pixel
// (shading normal, view depth; 0 where nothing was drawn): one image load a tap instead of two fetches and two decodes.
#ifndef FILTER_GEOMETRY_GLSL_H
#define FILTER_GEOMETRY_GLSL_H

#include "gbuffer.glsl.h"

// The pixel that is filtered.
struct filter_center {
    vec3 position;      // relative to the eye
    vec3 geometric;
    vec3 shading;
    float plane_scale;  // 1 / (distance from the tangent plane at which the weight is 1/e)
};

// Metres that a pixel covers, seen face on, at a view depth.
float pixel_footprint(float view_z) { return 2.0 * view_z * length(frame.up) / float(frame.height); }

vec3 filter_position(ivec2 pixel, float view_z)
{
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(frame.width, frame.height) * 2.0 - 1.0;
    return view_z * (frame.forward + ndc.x * frame.right - ndc.y * frame.up);
}

filter_center filter_center_of(ivec2 pixel, vec4 geometry, vec3 geometric)
{
    // Two footprints: above the rounding of the depth buffer, below what one sees as a step.
    return filter_center(filter_position(pixel, geometry.w), geometric, geometry.xyz,
                         0.5 / pixel_footprint(geometry.w));
}

// In [0,1]: whether the tap lies on the center's surface. The normal's exponent is 64 (SVGF uses 128, too strict for
// normal maps at one frame's noise).
float filter_geometry_weight(filter_center center, ivec2 tap, vec4 geometry)
{
    if (geometry.w <= 0.0)
        return 0.0;
    float cosine = max(dot(center.shading, geometry.xyz), 0.0);
    float power2 = cosine * cosine, power4 = power2 * power2, power8 = power4 * power4;
    float power16 = power8 * power8, power32 = power16 * power16;
    float distance = dot(center.geometric, filter_position(tap, geometry.w) - center.position) * center.plane_scale;
    return power32 * power32 * exp(-distance * distance);
}

#endif
