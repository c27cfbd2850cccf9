// Packs the lights for the gather, which reads each many times, into an image: some drivers (lavapipe, 2.5 times) read
// images faster than buffers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_gather.glsl.h"
#include "reservoir.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer grid_lights_block { grid_light grid_lights[]; };
layout(set = 0, binding = 2, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 3, scalar) readonly buffer order_block { uint order[]; };
layout(set = 0, binding = 4, rgba32ui) uniform writeonly uimage2D packed_lights;

layout(constant_id = 0) const uint EMISSION = 0u;
layout(constant_id = 1) const bool VPLS = false; // packs them instead of the grid lights

const vec3 OUT_OF_REACH = vec3(1e30); // of lights that send nothing

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (i >= (VPLS ? header.vpl_count : header.light_count))
        return;
    gather_light g;
    if (VPLS) {
        uint slot = order[i];
        vpl v = vpls[slot];
        float share = surface_share(v);
        g = gather_light(v.position, share == 0.0 ? even_near() : 0.0, v.color, gather_name(slot | RESERVOIR_VPL, share),
                         v.normal, vec3(0.0), vec3(0.0));
    } else {
        grid_light light = grid_lights[i];
        g = gather_light(light.intensity > 0.0 ? light.position : OUT_OF_REACH, grid_spread(EMISSION, light), light.color,
                         gather_name(i, surface_share(light.moment_diagonal)), light.normal, light.moment_diagonal,
                         light.moment_mixed);
    }
    ivec2 texel = gather_texel(VPLS ? push.grid_capacity + i : i);
    imageStore(packed_lights, texel, gather_pack_position(g));
    imageStore(packed_lights, texel + ivec2(1, 0), gather_pack_color(g));
    imageStore(packed_lights, texel + ivec2(2, 0), gather_pack_moments(g));
}
