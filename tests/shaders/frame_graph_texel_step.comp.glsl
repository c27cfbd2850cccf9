// One link of a chain of images: samples one, stores another.
#version 460

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform usampler2D before;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2D after;

void main()
{
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    ivec2 neighbour = (texel + ivec2(1, 0)) % textureSize(before, 0);
    imageStore(after, texel, texelFetch(before, texel, 0) * 3u + texelFetch(before, neighbour, 0));
}
