// The first rays of light paths: each leaves the source that the path is dealt to. One invocation a path; with
// LIST_BINDING, of those listed, and the batch has no ray behind them.
#ifndef VPL_TRACE_EMIT_GLSL_H
#define VPL_TRACE_EMIT_GLSL_H

#define RAYS_BINDING 0
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 1
#include "emitters.glsl.h"
#include "rays.glsl.h"
#include "sobol.glsl.h"
#include "vpl_trace.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 3, scalar) writeonly buffer flux_block { vec3 flux[]; }; // by ray
layout(set = 0, binding = 4, scalar) readonly buffer shares_block { vpl_share shares[]; };
layout(set = 0, binding = 5, scalar) readonly buffer sources_block { vpl_source sources[]; };
layout(set = 0, binding = 6, scalar) readonly buffer elements_block { vpl_element elements[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer starts_block { vec3 starts[]; }; // by path
layout(push_constant, scalar) uniform push_block {
    uint path_count;
    uint ray_count; // paths, and one without a ray where there are slots that no path fills
} push;

const uint DIRECTIONAL_TRIES = 8u; // five of six points or more lie in the shadow
const uint SOBOL_DIRECTIONAL = 16u; // groups of dimensions behind those of the bounces

struct light_ray {
    vec3 origin, direction;
    vec3 flux; // of the whole source, as if it had launched this path alone
};

// The element of the source whose part of its distribution holds u.
uint choose_element(float u, vpl_source source)
{
    uint low = source.first, high = source.first + source.count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (u < elements[middle].cdf)
            high = middle;
        else
            low = middle + 1u;
    }
    return low;
}

// Uniform direction in the cone around +z whose cosine is `cos_cone`; the sphere for -1.
vec3 cone_direction(vec2 u, float cos_cone)
{
    float z = 1.0 - u.x * (1.0 - cos_cone);
    float radius = sqrt(max(0.0, 1.0 - z * z));
    return vec3(radius * cos(2.0 * PI * u.y), radius * sin(2.0 * PI * u.y), z);
}

light_ray point_ray(punctual_light light, vec2 u)
{
    return light_ray(light.position, cone_direction(u, -1.0), light.color * (4.0 * PI));
}

light_ray spot_ray(punctual_light light, vec2 u)
{
    float cos_outer = -light.spot_offset / light.spot_scale;
    vec3 direction = basis_of(light.direction) * cone_direction(u, cos_outer);
    float falloff = clamp(dot(direction, light.direction) * light.spot_scale + light.spot_offset, 0.0, 1.0);
    return light_ray(light.position, direction, light.color * (falloff * falloff * 2.0 * PI * (1.0 - cos_outer)));
}

// Through points that stay where they are while the light turns, so that VPLs stay too: on the side of the scene's
// bounds that the light ends on, of the axis that it is closest to. Each path has a row of such points, in a room that
// repeats on that side, a little larger than the bounds' shadow there, and takes the first that lies in the shadow.
// A room grows in steps of an eighth of an octave, at which its points move; `phase` has few do so at a time. Larger
// steps move fewer, but leave more to the rows' further points, which are less evenly spread (relative L2 in the atrium
// .086 with whole octaves, .084 so, flicker .47 and .49 of that of VPLs at random).
light_ray directional_ray(punctual_light light, vec2 u, uint index, uint seed)
{
    vec3 d = light.direction, size = max(frame.scene_max - frame.scene_min, vec3(1e-4 * frame.scene_radius));
    int k = abs(d.y) >= max(abs(d.x), abs(d.z)) ? 1 : abs(d.x) >= abs(d.z) ? 0 : 2;
    ivec2 across = ivec2((k + 1) % 3, (k + 2) % 3);
    vec3 side = d / abs(d[k]) * size[k]; // across the bounds
    vec2 lean = vec2(side[across.x], side[across.y]), bounds = vec2(size[across.x], size[across.y]);
    vec2 low = min(lean, 0.0), shadow = bounds + abs(lean); // where it begins, from scene_min, and its size
    float phase = float((index >> 6) & 15u) / 16.0; // blocks of 64 points are well spread in themselves
    vec2 room = bounds * exp2((ceil(8.0 * log2(shadow / bounds) - phase) + phase) / 8.0);
    vec2 point = low + u * shadow; // when none of the row does
    for (uint n = 0u; n < DIRECTIONAL_TRIES; n++) {
        vec2 next = (n == 0u ? u : sobol(index, SOBOL_DIRECTIONAL + n, seed).xy) * room;
        next -= room * floor((next - low) / room); // in [low, low + room)
        if (all(lessThan(next, low + shadow))) {
            point = next;
            break;
        }
    }
    vec3 end = vec3(0.0);
    end[k] = d[k] < 0.0 ? frame.scene_min[k] : frame.scene_max[k];
    end[across.x] = frame.scene_min[across.x] + point.x;
    end[across.y] = frame.scene_min[across.y] + point.y;
    vec3 start = end - side - (0.01 * length(side) + 1e-3 * frame.scene_radius) * d;
    return light_ray(start, d, light.color * (shadow.x * shadow.y * abs(d[k])));
}

light_ray emitter_ray(emissive_triangle emitter, vec2 u, vec2 v)
{
    vec2 barycentrics = triangle_point(u);
    vec3 normal = emitter.normal;
    float sides = 1.0;
    if (emitter.two_sided != 0u) {
        sides = 2.0;
        normal = v.x < 0.5 ? normal : -normal;
        v.x = fract(2.0 * v.x);
    }
    vec3 radiance = emitter.emission;
    if (emitter.textured != 0u) {
        vec2 uv = emitter.uv0 + barycentrics.x * (emitter.uv1 - emitter.uv0) +
                  barycentrics.y * (emitter.uv2 - emitter.uv0);
        material m = materials[emitter.material];
        radiance = m.emissive * textureLod(textures[nonuniformEXT(m.emissive_texture.texture)], uv, 0.0).rgb;
    }
    vec3 position = emitter.corner + barycentrics.x * emitter.edge1 + barycentrics.y * emitter.edge2;
    return light_ray(offset_origin(position, normal, frame.scene_radius), basis_of(normal) * cosine_direction(v),
                     radiance * (PI * emitter.area * sides));
}

// Where there is no choice of an element, the sequence's first dimensions are for the ray.
light_ray emit(vpl_source source, uint index)
{
    uint seed = share_seed(source, frame.seed);
    vec4 a = sobol(index, 0u, seed);
    uint element = source.first;
    vec2 u = a.xy, v = a.zw;
    float probability = 1.0;
    if (source.count > 1u) {
        element = choose_element(a.x, source);
        probability = elements[element].cdf - (element > source.first ? elements[element - 1u].cdf : 0.0);
        u = a.yz;
        v = sobol(index, 1u, seed).xy;
    }
    uint light = elements[element].light;
    light_ray ray;
    if (light >= frame.light_count)
        ray = emitter_ray(emitters[light - frame.light_count], u, v);
    else if (lights[light].type == LIGHT_DIRECTIONAL)
        ray = directional_ray(lights[light], u, index, seed);
    else if (lights[light].type == LIGHT_SPOT)
        ray = spot_ray(lights[light], u);
    else
        ray = point_ray(lights[light], u);
    ray.flux /= probability * float(source.paths);
    return ray;
}

// True when the path has a source, so that a ray leaves it.
bool launch(uint path, uint ray_index)
{
    vpl_share share = shares[path];
    vpl_source source = sources[share.source];
    if (source.count == 0u) {
        ray_write_none(ray_index);
        return false;
    }
    light_ray ray = emit(source, share.index);
    ray_write(ray_index, ray.origin, ray.direction, RAY_FAR);
    flux[ray_index] = ray.flux;
    starts[path] = ray.origin;
    return true;
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    bool launched = false;
#ifdef LIST_BINDING
    bool has_path = i < list_count;
    uint path = has_path ? list_paths[i] : 0u;
#else
    bool has_path = i < push.path_count;
    uint path = i;
#endif
    if (has_path)
        launched = launch(path, i);
    else if (i < push.ray_count)
        ray_write_none(i);
    ray_count(uint(launched));
}

#endif
