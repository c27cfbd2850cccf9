// The first rays of light paths: a light source is chosen by power, and a ray leaves it. One invocation a path.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAYS_BINDING 0
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 1
#include "emitters.glsl.h"
#include "rays.glsl.h"
#include "sobol.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 3, scalar) writeonly buffer flux_block { vec3 flux[]; };
layout(push_constant, scalar) uniform push_block {
    uint path_count;
    uint ray_count; // paths, and one without a ray where there are slots that no path fills
} push;

struct light_ray {
    vec3 origin, direction;
    vec3 flux; // of the whole source, as if it had launched this path alone
};

// Index of the source whose part of the CDF holds u.
uint choose_source(float u, uint source_count)
{
    uint low = 0u, high = source_count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (u < light_cdf[middle])
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

// From the rectangle that the scene's bounds cover, seen along the light.
light_ray directional_ray(punctual_light light, vec2 u)
{
    mat3 basis = basis_of(light.direction);
    vec3 centre = 0.5 * (frame.scene_min + frame.scene_max);
    vec3 half_size = 0.5 * (frame.scene_max - frame.scene_min);
    vec3 extent = vec3(dot(abs(basis[0]), half_size), dot(abs(basis[1]), half_size), dot(abs(basis[2]), half_size));
    vec3 local = vec3((2.0 * u - 1.0) * extent.xy, -1.01 * extent.z - 1e-3 * frame.scene_radius);
    return light_ray(centre + basis * local, light.direction, light.color * (4.0 * extent.x * extent.y));
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

light_ray emit(uint path)
{
    vec4 a = sobol(path, 0u, frame.seed);
    vec4 b = sobol(path, 1u, frame.seed);
    uint source = choose_source(a.x, frame.light_count + frame.emitter_count);
    float probability = light_cdf[source] - (source > 0u ? light_cdf[source - 1u] : 0.0);
    light_ray ray;
    if (source >= frame.light_count)
        ray = emitter_ray(emitters[source - frame.light_count], a.yz, b.xy);
    else if (lights[source].type == LIGHT_DIRECTIONAL)
        ray = directional_ray(lights[source], a.yz);
    else if (lights[source].type == LIGHT_SPOT)
        ray = spot_ray(lights[source], a.yz);
    else
        ray = point_ray(lights[source], a.yz);
    ray.flux /= probability * float(push.path_count);
    return ray;
}

void main()
{
    uint path = gl_GlobalInvocationID.x;
    bool launched = path < push.path_count;
    if (launched) {
        light_ray ray = emit(path);
        ray_write(path, ray.origin, ray.direction, RAY_FAR);
        flux[path] = ray.flux;
    } else if (path < push.ray_count)
        ray_write_none(path);
    ray_count(uint(launched));
}
