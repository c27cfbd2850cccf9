// Fills an image with numbers that depend on the texel and a seed.
#version 460

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, r32ui) uniform writeonly uimage2D target;
layout(push_constant) uniform push { uint seed; };

void main()
{
    uvec2 texel = gl_GlobalInvocationID.xy;
    imageStore(target, ivec2(texel), uvec4(texel.x * 7u + texel.y * 1000u + seed));
}
