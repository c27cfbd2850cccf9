// Direct light of punctual lights and emissive triangles, "radiance over albedo": irradiance / pi, in nits.
#ifndef DIRECT_LIGHT_GLSL_H
#define DIRECT_LIGHT_GLSL_H

#include "gbuffer.glsl.h"

// ---- Punctual lights

struct light_arrival {
    vec3 light;     // unshadowed
    vec3 direction; // unit, towards the light
    float distance; // 1e30 for suns
};

light_arrival punctual_arrival(punctual_light source, gbuffer_point point)
{
    light_arrival a = light_arrival(vec3(0.0), -source.direction, 1e30);
    float intensity = 1.0;
    if (source.type != LIGHT_DIRECTIONAL) {
        vec3 offset = source.position - point.position;
        float square = max(dot(offset, offset), 1e-12);
        a.distance = sqrt(square);
        a.direction = offset / a.distance;
        intensity = 1.0 / square;
        if (source.type == LIGHT_SPOT) {
            float cone = dot(source.direction, -a.direction) * source.spot_scale + source.spot_offset;
            intensity *= clamp(cone, 0.0, 1.0) * clamp(cone, 0.0, 1.0);
        }
    }
    // A normal map never decides which side is lit.
    if (dot(point.geometric, a.direction) > 0.0)
        a.light = source.color * (intensity * max(dot(point.shading, a.direction), 0.0) / PI);
    return a;
}

// ---- Emissive triangles

// Height of p over the triangle's plane on its emitting side, metres; 0 where the triangle sends nothing to p. What
// lies in the plane but for rounding, such as the emitter itself, counts as in it.
float emitter_height(emissive_triangle e, vec3 p)
{
    float height = dot(e.normal, p - e.corner);
    if (e.two_sided != 0u)
        height = abs(height);
    return height > 1e-5 * frame.scene_radius ? height : 0.0;
}

vec3 emitter_radiance(emissive_triangle e, vec2 b)
{
    if (e.textured == 0u)
        return e.emission;
    material m = materials[e.material];
    vec2 uv = (1.0 - b.x - b.y) * e.uv0 + b.x * e.uv1 + b.y * e.uv2;
    return m.emissive * textureLod(textures[nonuniformEXT(m.emissive_texture.texture)], uv, 0.0).rgb;
}

// Light that a square metre of the emitter around the point with barycentrics b sends.
vec3 emitter_light(emissive_triangle e, vec2 b, gbuffer_point point)
{
    vec3 offset = e.corner + b.x * e.edge1 + b.y * e.edge2 - point.position;
    float square = max(dot(offset, offset), 1e-12);
    float cosine = dot(point.shading, offset);
    float height = emitter_height(e, point.position);
    if (height <= 0.0 || cosine <= 0.0 || dot(point.geometric, offset) <= 0.0)
        return vec3(0.0);
    return emitter_radiance(e, b) * (cosine * height / (square * square * PI));
}

// Cuts a convex polygon (at most 4 corners) by the plane through the origin, keeping dot(normal, corner) > 0; returns
// the number of corners left (Sutherland and Hodgman 1974).
uint polygon_clip(inout vec3 polygon[5], uint count, vec3 normal)
{
    vec3 clipped[5];
    uint kept = 0u;
    for (uint i = 0u; i < count; i++) {
        vec3 a = polygon[i], b = polygon[i + 1u == count ? 0u : i + 1u];
        float height_a = dot(normal, a), height_b = dot(normal, b);
        if (height_a > 0.0)
            clipped[kept++] = a;
        if ((height_a > 0.0) != (height_b > 0.0) && kept < 5u)
            clipped[kept++] = a + (b - a) * (height_a / (height_a - height_b));
    }
    polygon = clipped;
    return kept;
}

// The edge's term of Lambert's formula: angle between a and b times the normal component of their plane's unit normal.
float edge_irradiance(vec3 a, vec3 b, vec3 normal)
{
    vec3 area = cross(a, b);
    float sine = length(area);
    return sine > 0.0 ? dot(normal, area) / sine * atan(sine, dot(a, b)) : 0.0;
}

// Irradiance of a white triangle of radiance 1, closed form (Lambert 1760; Arvo 1995, "Applications of Irradiance
// Tensors"), cut at the horizons of the shading and of the geometric normal, as the samples are.
float triangle_irradiance(vec3 a, vec3 b, vec3 c, gbuffer_point point)
{
    vec3 shading = vec3(dot(point.shading, a), dot(point.shading, b), dot(point.shading, c));
    vec3 geometric = vec3(dot(point.geometric, a), dot(point.geometric, b), dot(point.geometric, c));
    if (all(lessThanEqual(shading, vec3(0.0))) || all(lessThanEqual(geometric, vec3(0.0))))
        return 0.0;
    vec3 n = point.shading;
    if (all(greaterThan(shading, vec3(0.0))) && all(greaterThan(geometric, vec3(0.0))))
        return 0.5 * abs(edge_irradiance(a, b, n) + edge_irradiance(b, c, n) + edge_irradiance(c, a, n));
    vec3 polygon[5] = vec3[5](a, b, c, vec3(0.0), vec3(0.0));
    uint count = polygon_clip(polygon, 3u, point.geometric);
    count = polygon_clip(polygon, count, n);
    float sum = 0.0;
    for (uint i = 0u; i < count; i++)
        sum += edge_irradiance(polygon[i], polygon[i + 1u == count ? 0u : i + 1u], n);
    return 0.5 * abs(sum);
}

vec3 emitter_light_exact(emissive_triangle e, gbuffer_point point)
{
    if (emitter_height(e, point.position) <= 0.0)
        return vec3(0.0);
    vec3 a = e.corner - point.position;
    return e.emission * (triangle_irradiance(a, a + e.edge1, a + e.edge2, point) / PI);
}

#endif
