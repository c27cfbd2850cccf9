// Writes `filter_geometry` (see filter_geometry.glsl.h) from the G-buffer.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gbuffer.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D geometry_map;

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    gbuffer_point point;
    bool drawn = gbuffer_read(depth_map, normal_map, pixel, point);
    imageStore(geometry_map, ivec2(pixel), drawn ? vec4(point.shading, point.view_z) : vec4(0.0));
}
