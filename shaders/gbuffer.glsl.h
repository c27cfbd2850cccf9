// Reading the G-buffer in later passes. Include after scene.glsl.h; the pass binds `depth` and `normals` as samplers.
#ifndef GBUFFER_GLSL_H
#define GBUFFER_GLSL_H

#include "scene.glsl.h"

struct gbuffer_point {
    vec3 position;  // world
    vec3 geometric; // unit normals towards the viewer
    vec3 shading;
    float view_z;   // metres along the camera's forward axis
};

// World position of a pixel's centre at a depth > 0 (see frame_constants).
vec3 gbuffer_position(uvec2 pixel, float depth)
{
    vec2 ndc = (vec2(pixel) + 0.5) / vec2(frame.width, frame.height) * 2.0 - 1.0;
    return frame.eye + frame.near_plane / depth * (frame.forward + ndc.x * frame.right - ndc.y * frame.up);
}

// False where nothing was drawn.
bool gbuffer_read(sampler2D depth_map, sampler2D normal_map, uvec2 pixel, out gbuffer_point point)
{
    float depth = texelFetch(depth_map, ivec2(pixel), 0).x;
    if (depth <= 0.0)
        return false;
    vec4 normals = texelFetch(normal_map, ivec2(pixel), 0);
    point.position = gbuffer_position(pixel, depth);
    point.geometric = octahedral_decode(normals.xy);
    point.shading = octahedral_decode(normals.zw);
    point.view_z = frame.near_plane / depth;
    return true;
}

#endif
