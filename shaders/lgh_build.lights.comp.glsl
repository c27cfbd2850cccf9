// From sums to grid lights: centre, deviation and the moments of the normals, normalised last.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 2, scalar) readonly buffer sums_block { lgh_sums sums[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer lights_block { grid_light lights[]; };

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (i >= header.light_count)
        return;
    uint c = light_exponent(header, i);
    lgh_sums s = sums[i];
    float scale = s.weight > 0.0 ? 1.0 / s.weight : 0.0; // a vertex on whose plane all its lights' weights vanish
    vec3 mean = s.position * scale;
    vec3 vertex = header.origin + vec3(unpack_vertex(vertices[i])) * header.levels[c].cell_size;
    // Of lights in a plane, rounding would leave a deviation along its normal, and end points behind it.
    vec3 square = s.square * scale, variance = square - mean * mean;
    variance = mix(vec3(0.0), variance, greaterThan(variance, 1e-5 * square));
    lights[i] = grid_light(vertex + mean, luminance(s.color), s.color, vertices[i], sqrt(variance), s.normal * scale,
                           s.moment_diagonal * scale, s.moment_mixed * scale);
}
