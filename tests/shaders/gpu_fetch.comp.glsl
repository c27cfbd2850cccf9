// Reads a sampled image of set 0 between its texels and beyond its edge.
#version 460

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) uniform sampler2D source;
layout(set = 0, binding = 1) writeonly buffer output_block { vec4 values[]; };

void main()
{
    vec2 size = vec2(textureSize(source, 0));
    values[0] = textureLod(source, vec2(2.9, 1.1) / size, 0.0);
    values[1] = textureLod(source, vec2(5.0), 0.0);
}
