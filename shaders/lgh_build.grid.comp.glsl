// Bounds of the VPLs, second half: one invocation joins the partials and lays the grid around them. The top level's cell
// is the longest edge of the bounds, a little padded (Lin and Yuksel 2019, section 3.1).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"
#include "lgh_build.glsl.h"

layout(local_size_x = 1) in;

void main()
{
    vec3 low = vec3(1e30), high = vec3(-1e30);
    uint count = 0u;
    for (uint i = 0u; i < push.partial_count; i++) {
        low = min(low, partials[i].low);
        high = max(high, partials[i].high);
        count += partials[i].count;
    }
    if (count == 0u)
        low = high = vec3(0.0);
    vec3 extent = high - low;
    float longest = max(max(extent.x, extent.y), extent.z);
    vec3 reach = max(abs(low), abs(high));
    float pad = 1e-4 * longest + 1e-5 * max(max(reach.x, reach.y), reach.z) + 1e-6;
    header.origin = low - pad;
    header.top_size = longest + 2.0 * pad;
    header.vpl_count = count;
}
