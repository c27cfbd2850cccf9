// Small helpers that every shader may use: constants, hashing, octahedral normals, frames.
#ifndef COMMON_GLSL_H
#define COMMON_GLSL_H

#extension GL_EXT_scalar_block_layout : require
#include "shared.h"

const float PI = 3.14159265358979;

// Rec. 709 luminance.
float luminance(vec3 color) { return dot(color, vec3(0.2126, 0.7152, 0.0722)); }

// PCG hash (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering").
uint hash(uint value)
{
    uint state = value * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}
uint hash(uint a, uint b) { return hash(a ^ (hash(b) + 0x9e3779b9u + (a << 6) + (a >> 2))); }
uint hash(uint a, uint b, uint c) { return hash(hash(a, b), c); }
uint hash(uint a, uint b, uint c, uint d) { return hash(hash(a, b, c), d); }

// In [0,1): 24 bits, so never 1.
float unit_float(uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }

// Octahedral map of unit vectors (Cigolle et al. 2014).
vec2 octahedral_encode(vec3 n)
{
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    vec2 folded = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    return n.z < 0.0 ? folded : p;
}
vec3 octahedral_decode(vec2 p)
{
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.xy += vec2(n.x >= 0.0 ? -fold : fold, n.y >= 0.0 ? -fold : fold);
    return normalize(n);
}

// Orthonormal basis whose third column is the unit vector n (Duff et al. 2017).
mat3 basis_of(vec3 n)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

// Cosine-weighted direction around +z from two numbers in [0,1); pdf = z / pi.
vec3 cosine_direction(vec2 u)
{
    float radius = sqrt(u.x);
    float angle = 2.0 * PI * u.y;
    return vec3(radius * cos(angle), radius * sin(angle), sqrt(max(0.0, 1.0 - u.x)));
}

// Origin of a ray that leaves a surface at p on the side of the geometric unit normal n: off the surface by a few units
// in the last place of the largest coordinate (after Wächter and Binder 2019, "A Fast and Robust Method for Avoiding
// Self-Intersection", simplified), and by a small share of the scene.
vec3 offset_origin(vec3 p, vec3 n, float scene_radius)
{
    float largest = max(max(abs(p.x), abs(p.y)), abs(p.z));
    return p + n * (2e-6 * largest + 1e-5 * scene_radius);
}

#endif
