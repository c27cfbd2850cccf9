// A vertex of the path tracer: what a ray that arrives brings, and which rays leave. See modules/path_trace.c.
#ifndef PATH_TRACE_GLSL_H
#define PATH_TRACE_GLSL_H

#include "direct_light.glsl.h"
#include "emitters.glsl.h"

layout(push_constant, scalar) uniform push_block { path_step push; };

// Power heuristic (Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 9.2.4): the weight
// of a sample of density `pdf` that another strategy draws with density `other`.
float mis_weight(float pdf, float other)
{
    float ratio = other / pdf;
    return 1.0 / (1.0 + ratio * ratio);
}

// ---- Densities

// The density, per square metre, with which points of an emissive triangle are chosen. 0: only rays that hit it by chance
// count, as for triangles with an alpha mask, since points on them do not know of its holes.
float emitter_density(uint triangle)
{
    emissive_triangle e = emitters[triangle];
    bool is_masked = (materials[e.material].flags & MATERIAL_ALPHA_MASK) != 0u;
    return is_masked ? 0.0 : emitter_probability(triangle, emitter_share()) / e.area;
}

// The same per steradian, seen from a point at this distance and height over the triangle's plane.
float emitter_density_towards(float density, float distance, float height)
{
    return height > 0.0 ? density * distance * distance * distance / height : 0.0;
}

// ---- What arrives

struct path_ray {
    vec3 origin, direction;
    float pdf; // per steradian
};

// Emission at a hit, with the weight of rays that hit emitters by chance. What could not have been chosen counts in full:
// triangles that are no known emitters (the mean of their texture is black), and what is seen in its plane but for
// rounding.
vec3 hit_emission(surface_hit hit, surface_vertices v, path_ray ray)
{
    material m = materials[v.material];
    vec3 w = vec3(1.0 - hit.barycentrics.x - hit.barycentrics.y, hit.barycentrics);
    vec3 emission = m.emissive;
    if (emission == vec3(0.0))
        return emission;
    vertex_attributes aa = attributes[v.vertex.x], ab = attributes[v.vertex.y], ac = attributes[v.vertex.z];
    if (m.emissive_texture.texture != TEXTURE_NONE)
        emission *= texture_read(m.emissive_texture, w.x * aa.uv0 + w.y * ab.uv0 + w.z * ac.uv0,
                                 w.x * aa.uv1 + w.y * ab.uv1 + w.z * ac.uv1, 0.0).rgb;
    mesh_instance_gpu instance = instances[hit.instance];
    emissive_triangle e;
    e.corner = instance_to_world(instance, positions[v.vertex.x]);
    e.edge1 = instance_to_world(instance, positions[v.vertex.y]) - e.corner;
    e.edge2 = instance_to_world(instance, positions[v.vertex.z]) - e.corner;
    e.normal = normalize(cross(e.edge1, e.edge2)) * (instance.mirrored != 0u ? -1.0 : 1.0);
    e.two_sided = (m.flags & MATERIAL_DOUBLE_SIDED) != 0u ? 1u : 0u;
    if (e.two_sided == 0u && dot(e.normal, ray.direction) >= 0.0)
        return vec3(0.0);
    float distance = length(e.corner + w.y * e.edge1 + w.z * e.edge2 - ray.origin);
    uint triangle = emitter_find(hit);
    float density = triangle < frame.emitter_count ? emitter_density(triangle) : 0.0;
    float other = emitter_density_towards(density, distance, emitter_height(e, ray.origin));
    return emission * mis_weight(ray.pdf, other);
}

// ---- What leaves

// Four numbers from four (pcg4d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering").
uvec4 hash4(uvec4 v)
{
    v = v * 1664525u + 1013904223u;
    for (uint round = 0u; round < 2u; round++) {
        v.x += v.y * v.w;
        v.y += v.z * v.x;
        v.z += v.x * v.y;
        v.w += v.y * v.z;
        v ^= round == 0u ? v >> 16u : uvec4(0u);
    }
    return v;
}

// Independent numbers in [0,1). A sequence of low discrepancy would err less, but its samples depend on each other, and
// the two halves' difference would no longer tell the error.
vec4 path_random(uint pixel, uint sample_index, uint block)
{
    return vec4(hash4(uvec4(pixel, sample_index, push.vertex * 2u + block, frame.seed)) >> 8u) * (1.0 / 16777216.0);
}

struct light_sample {
    vec3 light;  // at the vertex when nothing is in the way, radiance over albedo
    vec3 direction;
    float distance;
};

// One punctual light, chosen half by power and half evenly, so that a weak one nearby is not lost beside a sun.
light_sample punctual_sample(gbuffer_point point, vec2 u)
{
    float total = light_cdf[frame.light_count - 1u];
    uint low = 0u, high = frame.light_count - 1u;
    if (u.x < 0.5)
        low = min(uint(u.y * float(frame.light_count)), high);
    else
        while (low < high) {
            uint middle = (low + high) / 2u;
            if (light_cdf[middle] > u.y * total)
                high = middle;
            else
                low = middle + 1u;
        }
    float power = light_cdf[low] - (low > 0u ? light_cdf[low - 1u] : 0.0);
    float probability = 0.5 / float(frame.light_count) + (total > 0.0 ? 0.5 * power / total : 0.0);
    light_arrival a = punctual_arrival(lights[low], point);
    return light_sample(a.light / probability, a.direction, 0.9999 * a.distance);
}

// A point on one emissive triangle, weighted against the directions that hit emitters by chance.
light_sample emitter_sample(gbuffer_point point, vec3 u)
{
    float probability;
    uint triangle = emitter_at(u.x, emitter_share(), probability);
    emissive_triangle e = emitters[triangle];
    vec2 barycentrics = triangle_point(u.yz);
    vec3 end = e.corner + barycentrics.x * e.edge1 + barycentrics.y * e.edge2;
    vec3 offset = end - point.position;
    float distance = max(length(offset), 1e-12);
    vec3 light = emitter_light(e, barycentrics, point) * (e.area / probability);
    if (light == vec3(0.0))
        return light_sample(light, offset, distance);
    float pdf = emitter_density_towards(emitter_density(triangle), distance, emitter_height(e, point.position));
    light *= mis_weight(pdf, dot(point.shading, offset) / (distance * PI));
    // Off the emitter's plane on the lit side, so that the ray cannot hit the emitter itself.
    vec3 side = dot(e.normal, offset) < 0.0 ? e.normal : -e.normal;
    vec3 path = offset_origin(end, side, frame.scene_radius) - point.position;
    float reach = max(length(path), 1e-12);
    return light_sample(light, path / reach, reach);
}

#endif
