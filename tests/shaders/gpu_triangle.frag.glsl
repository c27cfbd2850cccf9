// The colour of the push constants.
#version 460

layout(push_constant) uniform push_block { vec4 color; float depth; };
layout(location = 0) out vec4 out_color;

void main() { out_color = color; }
