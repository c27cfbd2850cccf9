// What a pixel sees: normals, albedo, emission and motion. See modules/renderer.h for the targets.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gbuffer_draw.glsl.h"

layout(location = 0) in vec3 in_relative;
layout(location = 1) in vec3 in_previous_relative;
layout(location = 2) in vec3 in_normal;
layout(location = 3) in vec4 in_tangent;
layout(location = 4) in vec4 in_uvs;
layout(location = 5) in vec4 in_color;
layout(location = 6) flat in vec3 in_geometric;

layout(location = 0) out vec4 out_normals;
layout(location = 1) out vec4 out_albedo;
layout(location = 2) out vec4 out_emission;
layout(location = 3) out vec2 out_motion;

const float TINY = 1e-30;

vec3 normalize_or(vec3 v, vec3 fallback)
{
    float square = dot(v, v);
    return square > TINY ? v * inversesqrt(square) : fallback;
}

// With mip mapping by the implicit derivatives. A draw has one material, so that the index is uniform.
vec4 texture_sample(texture_reference reference)
{
    return texture(textures[reference.texture], texture_uv(reference, in_uvs.xy, in_uvs.zw));
}

// Tangent and bitangent from the screen's derivatives, for meshes without tangents (Schueler 2013, "Normal Mapping
// Without Precomputed Tangents"). glTF's bitangent points against v.
void tangents_of_derivatives(vec3 normal, vec2 uv, out vec3 tangent, out vec3 bitangent)
{
    vec3 dx = dFdx(in_relative), dy = dFdy(in_relative);
    vec2 uv_dx = dFdx(uv), uv_dy = dFdy(uv);
    vec3 across_x = cross(dy, normal), across_y = cross(normal, dx);
    tangent = across_x * uv_dx.x + across_y * uv_dy.x;
    bitangent = -(across_x * uv_dx.y + across_y * uv_dy.y);
    float side = dot(normal, cross(dx, dy)) < 0.0 ? -1.0 : 1.0;
    float scale = side * inversesqrt(max(max(dot(tangent, tangent), dot(bitangent, bitangent)), TINY));
    tangent *= scale;
    bitangent *= scale;
}

// The normal map's normal about the interpolated unit `normal`.
vec3 mapped_normal(material m, vec3 normal)
{
    vec3 tangent, bitangent;
    if (in_tangent.w != 0.0) {
        tangent = normalize_or(in_tangent.xyz, vec3(0.0));
        bitangent = cross(normal, tangent) * (in_tangent.w < 0.0 ? -1.0 : 1.0);
    } else {
        tangents_of_derivatives(normal, texture_uv(m.normal_texture, in_uvs.xy, in_uvs.zw), tangent, bitangent);
    }
    vec3 texel = (texture_sample(m.normal_texture).xyz * 2.0 - 1.0) * vec3(m.normal_scale, m.normal_scale, 1.0);
    return normalize_or(tangent * texel.x + bitangent * texel.y + normal * texel.z, normal);
}

// Bends a unit normal no more than it takes to be on the side of the unit `axis`.
vec3 bend_towards(vec3 normal, vec3 axis)
{
    const float LEAST_COSINE = 0.01;
    float missing = LEAST_COSINE - dot(normal, axis);
    return missing > 0.0 ? normalize_or(normal + missing * axis, axis) : normal;
}

// Pixels from here to where the point was in the last frame; far outside of the picture when it was behind the eye.
vec2 motion_vector()
{
    const vec2 OUTSIDE = vec2(30000.0);
    vec4 now = frame.view_projection * vec4(in_relative, 0.0);
    vec4 before = frame.previous_view_projection * vec4(in_previous_relative, 0.0);
    if (before.w < 0.01 * frame.near_plane)
        return OUTSIDE;
    vec2 motion = (before.xy / before.w - now.xy / now.w) * 0.5 * vec2(frame.width, frame.height);
    return clamp(motion, -OUTSIDE, OUTSIDE);
}

void main()
{
    material m = materials[primitives[draw.primitive].material];
    vec4 color = m.base_color;
    if (VERTEX_COLORS)
        color *= in_color;
    if (BASE_TEXTURE)
        color *= texture_sample(m.base_texture);
    vec3 emission = m.emissive;
    if (EMISSIVE_TEXTURE)
        emission *= texture_sample(m.emissive_texture).rgb;

    vec3 to_eye = normalize(-in_relative);
    vec3 geometric = normalize_or(in_geometric, to_eye);
    vec3 normal = normalize_or(in_normal, geometric);
    if (NORMAL_TEXTURE)
        normal = mapped_normal(m, normal);
    if (dot(geometric, to_eye) < 0.0) { // the back of a double-sided surface
        geometric = -geometric;
        normal = -normal;
    }
    normal = bend_towards(bend_towards(normal, geometric), to_eye);

    out_normals = vec4(octahedral_encode(geometric), octahedral_encode(normal));
    out_albedo = vec4(clamp(color.rgb, 0.0, 1.0), float(draw.identity) * (1.0 / 65535.0));
    out_emission = vec4(emission, 1.0);
    out_motion = MOVES ? motion_vector() : vec2(0.0);
    // Last, since the samples above need the derivatives of whole quads.
    if (ALPHA_MASK && color.a < m.alpha_cutoff)
        discard;
}
