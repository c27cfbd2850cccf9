// The scene as shaders see it (set 1): frame constants, geometry, materials, lights, textures.
#ifndef SCENE_GLSL_H
#define SCENE_GLSL_H

#include "common.glsl.h"
#extension GL_EXT_nonuniform_qualifier : require

layout(set = 1, binding = SCENE_FRAME, scalar) readonly buffer frame_block { frame_constants frame; };
layout(set = 1, binding = SCENE_POSITIONS, scalar) readonly buffer positions_block { vec3 positions[]; };
layout(set = 1, binding = SCENE_ATTRIBUTES, scalar) readonly buffer attributes_block { vertex_attributes attributes[]; };
layout(set = 1, binding = SCENE_INDICES, scalar) readonly buffer indices_block { uint indices[]; };
layout(set = 1, binding = SCENE_PRIMITIVES, scalar) readonly buffer primitives_block { mesh_primitive primitives[]; };
layout(set = 1, binding = SCENE_INSTANCES, scalar) readonly buffer instances_block { mesh_instance_gpu instances[]; };
layout(set = 1, binding = SCENE_MATERIALS, scalar) readonly buffer materials_block { material materials[]; };
layout(set = 1, binding = SCENE_LIGHTS, scalar) readonly buffer lights_block { punctual_light lights[]; };
layout(set = 1, binding = SCENE_EMITTERS, scalar) readonly buffer emitters_block { emissive_triangle emitters[]; };
layout(set = 1, binding = SCENE_LIGHT_CDF, scalar) readonly buffer light_cdf_block { float light_cdf[]; };
layout(set = 1, binding = SCENE_PREVIOUS_POSITIONS, scalar) readonly buffer previous_positions_block {
    vec3 previous_positions[];
};
layout(set = 1, binding = SCENE_TEXTURES) uniform sampler2D textures[];

vec2 texture_uv(texture_reference reference, vec2 uv0, vec2 uv1)
{
    vec2 uv = reference.uv_set == 0u ? uv0 : uv1;
    return mat2(reference.transform.xy, reference.transform.zw) * uv + reference.offset;
}

// Only for references that are not TEXTURE_NONE.
vec4 texture_read(texture_reference reference, vec2 uv0, vec2 uv1, float lod)
{
    return textureLod(textures[nonuniformEXT(reference.texture)], texture_uv(reference, uv0, uv1), lod);
}

vec4 vertex_color(vertex_attributes a) { return vec4(unpackUnorm2x16(a.color_rg), unpackUnorm2x16(a.color_ba)); }

vec3 instance_to_world(mesh_instance_gpu instance, vec3 p)
{
    vec4 h = vec4(p, 1.0);
    return vec3(dot(instance.world[0], h), dot(instance.world[1], h), dot(instance.world[2], h));
}

// A point on a triangle, as a ray finds it.
struct surface_hit {
    uint instance;  // index into `instances`
    uint geometry;  // the primitive within its mesh
    uint triangle;  // within the primitive
    vec2 barycentrics;
};

struct surface_vertices {
    uvec3 vertex; // indices into positions and attributes
    uint material;
};

surface_vertices hit_vertices(surface_hit hit)
{
    mesh_primitive primitive = primitives[instances[hit.instance].first_primitive + hit.geometry];
    uint first = primitive.first_index + 3u * hit.triangle;
    return surface_vertices(uvec3(indices[first], indices[first + 1u], indices[first + 2u]) + primitive.first_vertex,
                            primitive.material);
}

// Base colour with texture and vertex colour; a: alpha.
vec4 hit_base_color(surface_hit hit, surface_vertices v, float lod)
{
    material m = materials[v.material];
    vec3 w = vec3(1.0 - hit.barycentrics.x - hit.barycentrics.y, hit.barycentrics);
    vertex_attributes a = attributes[v.vertex.x], b = attributes[v.vertex.y], c = attributes[v.vertex.z];
    vec4 color = m.base_color * (w.x * vertex_color(a) + w.y * vertex_color(b) + w.z * vertex_color(c));
    if (m.base_texture.texture != TEXTURE_NONE)
        color *= texture_read(m.base_texture, w.x * a.uv0 + w.y * b.uv0 + w.z * c.uv0,
                              w.x * a.uv1 + w.y * b.uv1 + w.z * c.uv1, lod);
    return color;
}

struct surface {
    vec3 position; // world
    vec3 normal;   // unit geometric normal, on the side of the winding's front face
    vec3 albedo;
    uint material;
};

surface hit_surface(surface_hit hit)
{
    surface_vertices v = hit_vertices(hit);
    mesh_instance_gpu instance = instances[hit.instance];
    vec3 a = instance_to_world(instance, positions[v.vertex.x]);
    vec3 b = instance_to_world(instance, positions[v.vertex.y]);
    vec3 c = instance_to_world(instance, positions[v.vertex.z]);
    surface s;
    s.position = a + hit.barycentrics.x * (b - a) + hit.barycentrics.y * (c - a);
    s.normal = normalize(cross(b - a, c - a)) * (instance.mirrored != 0u ? -1.0 : 1.0);
    s.albedo = clamp(hit_base_color(hit, v, 0.0).rgb, 0.0, 1.0);
    s.material = v.material;
    return s;
}

#endif
