// Two triangles, counter-clockwise in the framebuffer, over the left half of the image, at the push constants' depth.
#version 460

layout(push_constant) uniform push_block { vec4 color; float depth; };

void main()
{
    vec2 corners[6] = vec2[](vec2(-1, -1), vec2(-1, 1), vec2(0, 1), vec2(0, 1), vec2(0, -1), vec2(-1, -1));
    gl_Position = vec4(corners[gl_VertexIndex], depth, 1);
}
