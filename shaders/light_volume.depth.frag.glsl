// The G-buffer's depth in the tiled layout, for culling light volumes there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl.h"
#include "interleave.glsl.h"

layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(push_constant, scalar) uniform push_block { uint interleave; } push;

void main()
{
    uvec2 size = uvec2(frame.width, frame.height);
    uvec2 pixel = interleave_pixel(uvec2(gl_FragCoord.xy), push.interleave, size);
    gl_FragDepth = all(lessThan(pixel, size)) ? texelFetch(depth_map, ivec2(pixel), 0).x : 0.0;
}
