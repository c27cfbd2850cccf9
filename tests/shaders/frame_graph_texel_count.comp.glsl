// Counts frames in each texel: one more than the history, or 1 where it is not valid.
#version 460

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform usampler2D history;
layout(set = 0, binding = 1, r32ui) uniform writeonly uimage2D counts;
layout(push_constant) uniform push { uint valid; };

void main()
{
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(counts))))
        return;
    uint before = valid != 0u ? texelFetch(history, texel, 0).x : 0u;
    imageStore(counts, texel, uvec4(before + 1u));
}
