// A light on its way from the vertex to the fragment stage: flat, so that fragments need not fetch it. Before including,
// define STAGE as `in` or `out`.
#ifndef LIGHT_VOLUME_VARYINGS_GLSL_H
#define LIGHT_VOLUME_VARYINGS_GLSL_H

layout(location = 0) flat STAGE vec4 light_position; // w: r
layout(location = 1) flat STAGE vec3 light_color;    // dealt lights n^2 times
layout(location = 1, component = 3) flat STAGE float light_spread; // grid_spread
layout(location = 2) flat STAGE vec3 light_normal;
layout(location = 2, component = 3) flat STAGE float light_share; // surface_share
layout(location = 3) flat STAGE vec3 light_diagonal; // of the second moment of the normals
layout(location = 4) flat STAGE vec3 light_mixed;
layout(location = 5) flat STAGE uvec4 light_names; // name in reservoirs, vertex or slot, exponent, kind of blending function

#endif
