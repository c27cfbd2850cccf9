// Empties a mask: the words that `filled` has bits of. The includer says which bindings.
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = CLEAR_BINDING, scalar) writeonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = FILLED_BINDING, scalar) buffer filled_block { uvec4 filled[]; };
layout(push_constant, scalar) uniform push_block {
    uint words; // of the mask
    uint fresh; // 1: both are new, and mean nothing
} push;

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (i >= (push.words + 127u) / 128u)
        return;
    uvec4 words = push.fresh != 0u ? uvec4(0xffffffffu) : filled[i];
    if (words == uvec4(0u))
        return;
    for (uint k = 0u; k < 4u; k++)
        for (uint bits = words[k]; bits != 0u; bits &= bits - 1u) {
            uint word = i << 7 | k << 5 | uint(findLSB(bits));
            if (word < push.words)
                masks[word] = 0u;
        }
    filled[i] = uvec4(0u);
}
