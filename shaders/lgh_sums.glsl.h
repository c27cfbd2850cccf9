// Adding lights to a vertex's sums.
#ifndef LGH_SUMS_GLSL_H
#define LGH_SUMS_GLSL_H

#include "lgh.glsl.h"

lgh_sums sums_zero()
{
    return lgh_sums(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0u);
}

// What a light adds with trilinear weight t; `local` is its position relative to the vertex.
lgh_sums sums_of(vpl light, vec3 local, float t, bool demo)
{
    float w = demo ? t : t * light.intensity;
    vec3 n = light.normal;
    return lgh_sums(t * light.color, w, w * local, w * local * local, w * n, w * n * n, w * n.xxy * n.yzz, 0u);
}

void sums_add(inout lgh_sums a, lgh_sums b)
{
    a.color += b.color;
    a.weight += b.weight;
    a.position += b.position;
    a.square += b.square;
    a.normal += b.normal;
    a.moment_diagonal += b.moment_diagonal;
    a.moment_mixed += b.moment_mixed;
}

// The sums times t, as seen from a vertex from which the old one lies at `shift`.
lgh_sums sums_moved(lgh_sums s, vec3 shift, float t)
{
    vec3 square = s.square + 2.0 * shift * s.position + shift * shift * s.weight;
    vec3 position = s.position + shift * s.weight;
    return lgh_sums(t * s.color, t * s.weight, t * position, t * square, t * s.normal, t * s.moment_diagonal,
                    t * s.moment_mixed, 0u);
}

// Trilinear weight of a light at grid offset `offset` (in cells) from the vertex.
float trilinear(vec3 offset)
{
    vec3 t = max(vec3(0.0), 1.0 - abs(offset));
    return t.x * t.y * t.z;
}

#endif
