// Empties as much of a mask as the steps after it use; the dispatch says how much. The includer says which binding.
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = CLEAR_BINDING, scalar) writeonly buffer masks_block { uint masks[]; };
layout(push_constant, scalar) uniform push_block { uint words; } push; // of the whole mask

void main()
{
    uint word = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (word < push.words)
        masks[word] = 0u;
}
