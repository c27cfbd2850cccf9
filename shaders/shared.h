// What the CPU and the shaders share: structs in scalar layout, constants and enums. Included by C and by GLSL
// (with GL_EXT_scalar_block_layout), so each exists once.
#ifndef LANTERNFIELD_SHARED_H
#define LANTERNFIELD_SHARED_H

#ifdef VULKAN // defined by glslang
#define SHARED_VEC2(name) vec2 name
#define SHARED_VEC3(name) vec3 name
#define SHARED_VEC4(name) vec4 name
#define SHARED_MAT4(name) mat4 name
#define SHARED_STRUCT(name) struct name
#define SHARED_END(name, size) ;
#else
#include <stdint.h>
typedef uint32_t uint;
#define SHARED_VEC2(name) float name[2]
#define SHARED_VEC3(name) float name[3]
#define SHARED_VEC4(name) float name[4]
#define SHARED_MAT4(name) float name[16] // column-major
#define SHARED_STRUCT(name) typedef struct name name; struct name
#define SHARED_END(name, size) ; _Static_assert(sizeof(name) == (size), "scalar layout");
#ifdef __cplusplus
#undef SHARED_END
#define SHARED_END(name, size) ; static_assert(sizeof(name) == (size), "scalar layout");
#endif
#endif

// ---- The scene (set 1)

#define SCENE_FRAME 0      // frame_constants
#define SCENE_POSITIONS 1  // vec3 per vertex, mesh space
#define SCENE_ATTRIBUTES 2 // vertex_attributes per vertex
#define SCENE_INDICES 3    // uint, relative to the primitive's first vertex
#define SCENE_PRIMITIVES 4
#define SCENE_INSTANCES 5
#define SCENE_MATERIALS 6
#define SCENE_LIGHTS 7     // punctual_light
#define SCENE_EMITTERS 8   // emissive_triangle
#define SCENE_LIGHT_CDF 9  // float per light source: inclusive sums of the choice probabilities, last is 1
#define SCENE_PREVIOUS_POSITIONS 10 // vec3 per vertex of a deforming mesh: where it was in the last frame
#define SCENE_TEXTURES 12

SHARED_STRUCT(frame_constants) {
    SHARED_MAT4(view_projection);          // reversed infinite depth: near/distance, 1 at the near plane, 0 at infinity
    SHARED_MAT4(previous_view_projection); // last frame's
    SHARED_VEC3(eye);                      // world
    float near_plane;                      // metres
    SHARED_VEC3(forward);                  // unit; world position = eye + view_z * (forward + x * right + y * up),
    float scene_radius;                    //   view_z = near_plane / depth, x and y in [-1,1], y up
    SHARED_VEC3(right);                    // scaled by tan(fov_x / 2)
    uint frame;                            // counts from 0; keys random numbers
    SHARED_VEC3(up);                       // scaled by tan(fov_y / 2)
    uint seed;
    SHARED_VEC3(scene_min);                // bounds of all instances, world
    uint width;
    SHARED_VEC3(scene_max);
    uint height;
    SHARED_VEC3(previous_eye);
    uint light_count;                      // punctual
    SHARED_VEC3(previous_forward);         // unit, as `forward`: rebuilds last frame's positions
    uint emitter_count;                    // emissive triangles
    SHARED_VEC3(previous_right);
    float exposure_ev;                     // when not automatic
    SHARED_VEC3(previous_up);
    uint auto_exposure;                    // 1: EV puts the log-average at 0.18
} SHARED_END(frame_constants, 128 + 10 * 16)

SHARED_STRUCT(vertex_attributes) {
    SHARED_VEC3(normal);
    SHARED_VEC4(tangent); // w: sign of the bitangent; 0: no tangent
    SHARED_VEC2(uv0);
    SHARED_VEC2(uv1);
    uint color_rg, color_ba; // linear, unorm16 pairs, multiplies the base colour
} SHARED_END(vertex_attributes, 52)

// A range of triangles with one material; the geometries of a mesh's BLAS are its primitives in order.
SHARED_STRUCT(mesh_primitive) {
    uint first_index, index_count;
    uint first_vertex, vertex_count;
    uint material;
} SHARED_END(mesh_primitive, 20)

SHARED_STRUCT(mesh_instance_gpu) {
    SHARED_VEC4(world[3]);          // rows of the 3x4 matrix from mesh to world
    SHARED_VEC4(previous_world[3]);
    SHARED_VEC4(normal_matrix[3]);  // rows of the inverse transpose up to a positive factor; w unused
    uint first_primitive, primitive_count;
    uint mirrored;                  // 1: the determinant is negative
    uint mesh;
    uint previous_vertex;           // its first vertex in the previous positions; PREVIOUS_SAME: they are as they were
} SHARED_END(mesh_instance_gpu, 164)
#define PREVIOUS_SAME 0xffffffffu

#define TEXTURE_NONE 0xffffffffu
SHARED_STRUCT(texture_reference) {
    uint texture; // index into the bindless array, or TEXTURE_NONE
    uint uv_set;  // 0 or 1
    SHARED_VEC4(transform); // columns of KHR_texture_transform's 2x2 part: uv' = mat2(xy, zw) * uv + offset
    SHARED_VEC2(offset);
} SHARED_END(texture_reference, 32)

#define MATERIAL_ALPHA_MASK 1u
#define MATERIAL_DOUBLE_SIDED 2u
SHARED_STRUCT(material) {
    SHARED_VEC4(base_color); // linear
    SHARED_VEC3(emissive);   // nits: factor times KHR_materials_emissive_strength
    float alpha_cutoff;
    uint flags;
    float normal_scale;
    float metallic, roughness; // read and kept; diffuse reflection does not use them yet
    texture_reference base_texture, emissive_texture, normal_texture, metallic_roughness_texture;
} SHARED_END(material, 176)

#define LIGHT_POINT 0u
#define LIGHT_SPOT 1u
#define LIGHT_DIRECTIONAL 2u
SHARED_STRUCT(punctual_light) {
    SHARED_VEC3(position); // point and spot
    uint type;
    SHARED_VEC3(color);     // candela per channel; directional: lux
    float spot_scale;       // KHR_lights_punctual: clamp(cos * spot_scale + spot_offset, 0, 1)^2
    SHARED_VEC3(direction); // unit, the direction in which the light travels
    float spot_offset;
} SHARED_END(punctual_light, 48)

SHARED_STRUCT(emissive_triangle) {
    SHARED_VEC3(corner); // world
    uint material;
    SHARED_VEC3(edge1);  // second corner minus first
    float area;          // m^2
    SHARED_VEC3(edge2);  // third corner minus first
    uint two_sided;
    SHARED_VEC3(normal); // unit, geometric front side
    uint textured;       // 1: emission varies over the triangle
    SHARED_VEC3(emission); // nits, mean over the triangle
    uint instance; // where a ray hits it, as ray_hit has it; the array is sorted by these three
    SHARED_VEC2(uv0);    // for the emissive texture, transform applied
    SHARED_VEC2(uv1);
    SHARED_VEC2(uv2);
    uint geometry;
    uint triangle;
} SHARED_END(emissive_triangle, 112)

// ---- Deformation of vertices (modules/deform.h)

#define DEFORM_INFLUENCES 8
SHARED_STRUCT(deform_vertex) { // at rest, mesh space
    SHARED_VEC3(position);
    SHARED_VEC3(normal);
    SHARED_VEC4(tangent); // w: 0: none
} SHARED_END(deform_vertex, 40)

SHARED_STRUCT(deform_influences) {
    uint joints[DEFORM_INFLUENCES / 2]; // pairs of 16 bits, the first is the lower half
    float weights[DEFORM_INFLUENCES];   // sum 1
} SHARED_END(deform_influences, 48)

SHARED_STRUCT(deform_offset) { // that a morph target of weight 1 adds
    SHARED_VEC3(position);
    SHARED_VEC3(normal);
    SHARED_VEC3(tangent);
} SHARED_END(deform_offset, 36)

SHARED_STRUCT(deform_joint) { // rows of the matrix from the mesh at rest to the world
    SHARED_VEC4(rows[3]);
} SHARED_END(deform_joint, 48)

SHARED_STRUCT(deform_target) { // a morph target in use
    uint first_offset; // of its vertices, index into the offsets
    float weight;
} SHARED_END(deform_target, 8)

SHARED_STRUCT(deform_range) { // the vertices of one mesh
    uint vertex_count;
    uint first_vertex;    // in the scene's positions and attributes
    uint first_kept;      // in the vertices at rest and the previous positions
    uint first_influence; // of the first vertex
    uint first_joint;
    uint is_skinned;
    uint first_target, target_count;
} SHARED_END(deform_range, 32)

// ---- Passes over pixels

// Invocations of a workgroup, all in one row: on a CPU device a tile of 8x8 takes up to half as long again, since the rows
// of all images of one size fall on the same few sets of its cache.
#define PIXEL_GROUP_WIDTH 64

// ---- Subdivision surfaces (modules/subdivision.h)

#define SUBDIVIDE_GROUP 64 // invocations of a workgroup, one a vertex

SHARED_STRUCT(subdivision_entry) { // of a stencil
    uint vertex; // of the cage
    float position, tangent1, tangent2; // weights
} SHARED_END(subdivision_entry, 16)

SHARED_STRUCT(subdivision_vertex) { // of a refined mesh
    uint stencil;
    SHARED_VEC2(tangent); // the texture's tangent is x * tangent1 + y * tangent2; both 0: none
} SHARED_END(subdivision_vertex, 12)

SHARED_STRUCT(subdivision_step) { // of one refined mesh
    uint first_source; // vertex that the entries count from
    uint first_vertex, vertex_count; // what is written
    uint first; // of its subdivision_vertex structs
    uint first_kept; // in the previous positions
    uint is_new; // 1: it was not drawn in the last frame, so that its vertices have not moved since
} SHARED_END(subdivision_step, 24)

// ---- Rays

#define RAY_MISS 0xffffffffu
SHARED_STRUCT(ray_hit) {
    uint instance;  // index into the instances, or RAY_MISS
    uint geometry;  // the primitive within its mesh
    uint triangle;  // within the primitive
    SHARED_VEC2(barycentrics); // weights of its second and third corner
} SHARED_END(ray_hit, 20)

#define RAYS_GROUP 256 // invocations of a workgroup that traces; 128: too many for two rays at 2048x2048 pixels
#define RAY_ORDER_BUCKETS (1 << 18)
#define RAY_ORDER_GROUPS 256 // workgroups that make room for the buckets
SHARED_STRUCT(ray_order_header) { // VkDispatchIndirectCommand in front
    uint groups_x, groups_y, groups_z; // workgroups of RAYS_GROUP
    uint rays; // listed
} SHARED_END(ray_order_header, 16)

#define DIRECT_SAMPLES_MAX 8 // shadow rays a pixel for each kind of sampled direct light

// ---- Path tracing

SHARED_STRUCT(path_state) {
    SHARED_VEC3(throughput); // product of the albedos so far, without the first vertex's
    SHARED_VEC3(light);      // gathered so far at the first vertex, radiance over albedo, nits
} SHARED_END(path_state, 24)

// What a vertex of a path does
#define PATH_GATHER 1u   // direct light at it counts
#define PATH_EMISSION 2u // emission that the ray towards it met counts
#define PATH_NEXT 4u     // a ray leaves it
SHARED_STRUCT(path_step) {
    uint pixels;       // of the picture
    uint count;        // paths of this frame: index = layer * pixels + pixel
    uint first_sample; // of this frame: sample = first_sample + layer
    uint vertex;       // 0 is what the pixel sees
    uint flags;        // PATH_*
} SHARED_END(path_step, 20)

// ---- Virtual point lights

SHARED_STRUCT(vpl_share) { // what a light path stands for
    uint source; // index into the vpl_sources
    uint index;  // among the source's paths
} SHARED_END(vpl_share, 8)

SHARED_STRUCT(vpl_source) { // one light source, or several among which its paths choose by power
    uint first, count; // vpl_elements; none: its paths are not launched
    uint paths;        // each has 1 / paths of the flux
    uint key;          // scrambles the paths' sequence
    uint changed;      // 1: all of its paths are traced anew
} SHARED_END(vpl_source, 20)

SHARED_STRUCT(vpl_element) {
    uint light; // punctual light, or light_count + emissive triangle
    float cdf;  // inclusive sum of the probabilities within the source, the last is 1
} SHARED_END(vpl_element, 8)

SHARED_STRUCT(vpl_box) { // where surfaces changed, world
    SHARED_VEC3(low);
    SHARED_VEC3(high);
} SHARED_END(vpl_box, 24)

SHARED_STRUCT(vpl) {
    SHARED_VEC3(position); // world
    float intensity;       // luminance of `color`; 0: an empty slot
    SHARED_VEC3(color);    // cd per channel: flux * albedo / pi
    uint path;
    SHARED_VEC3(normal);   // unit geometric normal on the lit side; 0: a point light of color / 4 cd, see lgh_shade.glsl.h
    uint bounce;           // 0 is the first hit
} SHARED_END(vpl, 48)

// ---- Probes: pixels at which every VPL is summed (modules/probe.h). All light is radiance, nits.

#define PROBE_RAYS 128u // of a probe: a quarter for each of two estimates of each half of the VPLs

SHARED_STRUCT(probe) {
    uint x, y;  // pixel
    uint drawn; // 0: nothing is there, and all light is zero
    SHARED_VEC3(shown);              // indirect light of the picture
    SHARED_VEC3(shown_unshadowed);   // the hierarchy's, before shadows
    SHARED_VEC3(unshadowed);         // sum over all VPLs
    SHARED_VEC3(shadowed[2][2]);     // [estimate][half]: of the sum over the VPLs of a half that are visible
} SHARED_END(probe, 12 + 36 + 48)

// ---- The lighting grid hierarchy. Resolution exponent c: cells of 1 / 2^c of the top level's; level l of L has c = L - l.

#define LGH_EXPONENTS 9       // candidate exponents 0..8, so at most 9 levels and 512 cells along an axis of the grid
#define LGH_SCAN_WORDS 2048   // mask words that one workgroup scans
#define LGH_CLEAR_WORDS 32768 // ... and that one clears: 128 an invocation
#define LGH_STRETCH 4096      // VPL slots that one workgroup looks through
#define LGH_SORT_BITS 4       // of the key, in one pass of the sort
#define LGH_SORT_PASSES 7     // for keys of 3 LGH_EXPONENTS bits

#define EMISSION_DEMO 0u
#define EMISSION_MEAN_NORMAL 1u
#define EMISSION_A 2u
#define EMISSION_B 3u
#define EMISSION_AB 4u

// A vertex's sums over its lights, weighted by trilinear t and w: w = intensity, or 1 for the emission model `demo`.
SHARED_STRUCT(lgh_sums) {
    SHARED_VEC3(color);  // sum t c
    float weight;        // sum t w
    SHARED_VEC3(position); // sum t w p, p relative to the vertex, metres
    SHARED_VEC3(square);   // sum t w p^2, per axis
    SHARED_VEC3(normal);   // sum t w n
    SHARED_VEC3(moment_diagonal); // sum t w (nx nx, ny ny, nz nz)
    SHARED_VEC3(moment_mixed);    // sum t w (nx ny, nx nz, ny nz)
    uint count; // unused by shading; pads to 80 bytes
} SHARED_END(lgh_sums, 80)

SHARED_STRUCT(grid_light) {
    SHARED_VEC3(position);  // illumination centre, world
    float intensity;        // luminance of `color`
    SHARED_VEC3(color);     // cd per channel, the sum over its lights
    uint vertex;            // x | y << 10 | z << 20, on the grid of its level
    SHARED_VEC3(deviation); // standard deviation of the lights' positions, per axis, metres
    SHARED_VEC3(normal);    // mean normal m, not unit
    SHARED_VEC3(moment_diagonal); // second moment M of the normals; its trace is the share of VPLs of surfaces
    SHARED_VEC3(moment_mixed);
} SHARED_END(grid_light, 80)

SHARED_STRUCT(lgh_level) { // by exponent c
    uint occupied;    // vertices with light
    uint first_light; // in the merged array: exponent 0 (the top) first
    float cell_size;  // metres
    float radius;     // r = alpha * cell_size
} SHARED_END(lgh_level, 16)

SHARED_STRUCT(lgh_dispatch) { // VkDispatchIndirectCommand, padded
    uint x, y, z, pad;
} SHARED_END(lgh_dispatch, 16)

SHARED_STRUCT(lgh_draw) { // VkDrawIndirectCommand
    uint vertex_count, instance_count, first_vertex, first_instance;
} SHARED_END(lgh_draw, 16)

SHARED_STRUCT(lgh_header) {
    SHARED_VEC3(origin); // corner of the grid, world; the grid is 2 top_size wide
    float top_size;      // edge of the top level's cell, metres
    uint level_count;    // 0: no light at all
    uint light_count;    // grid lights of all levels
    uint vpl_count;      // occupied slots
    uint word_count;     // vertex mask words of the levels in use
    lgh_level levels[LGH_EXPONENTS];
    lgh_dispatch scan_dispatch[2]; // [0] vertex masks, [1] cell masks of S1: LGH_SCAN_WORDS per workgroup
    lgh_dispatch light_dispatch;  // one invocation per grid light
    lgh_dispatch first_dispatch;  // one invocation per vertex of S1
    lgh_dispatch restrict_dispatch[LGH_EXPONENTS]; // [t] builds S_(t+1), t >= 1: one invocation per vertex
    lgh_dispatch gather_dispatch[LGH_EXPONENTS];   // the same by one workgroup per vertex
    lgh_draw volume_draw;       // light volumes of the levels between S1 and the top: 14 vertices an instance
    lgh_draw volume_first_draw; // those of S1, where it is not the top
} SHARED_END(lgh_header, 32 + 16 * LGH_EXPONENTS + 64 + 32 * LGH_EXPONENTS + 32)

SHARED_STRUCT(lgh_partial) { // of a stretch of VPL slots
    SHARED_VEC3(low);  // bounds of its VPLs
    uint count;        // VPLs; then those before it
    SHARED_VEC3(high);
    uint removed;      // incremental: VPLs of last frame that changed
} SHARED_END(lgh_partial, 32)

// Of lgh_build alone. Stage 0 builds on the last frame's grid and level count; stage 1, when these do not fit any more,
// starts anew. The dispatches of the stage that does not run are zero.
SHARED_STRUCT(lgh_state) {
    float density; // vertices of S1 for each VPL when the level count was chosen; kept from frame to frame
    uint fresh;    // 1: stage 1 runs
    uint listed;   // VPLs to sort: all, or in an incremental build those that changed
    uint last_count; // incremental: length of last frame's sorted list, which they are merged into
    uint counts[LGH_EXPONENTS]; // marked vertices
    uint dirty[LGH_EXPONENTS];  // incremental: vertices to build again
    lgh_dispatch once[2];
    lgh_dispatch stretches[2]; // LGH_STRETCH slots per workgroup
    lgh_dispatch words;        // vertex masks that stage 1 clears, LGH_CLEAR_WORDS per workgroup
    lgh_dispatch vpls[2];      // the list of VPLs, 256 per workgroup
    lgh_dispatch sort[LGH_SORT_PASSES]; // by passes that follow
    lgh_dispatch runs;         // of last frame's sorted list, for merging
    lgh_dispatch list;         // the final sorted list of VPLs, 256 per workgroup
    lgh_dispatch dirty_dispatch[LGH_EXPONENTS]; // 64 vertices per workgroup
} SHARED_END(lgh_state, 16 + 8 * LGH_EXPONENTS + 16 * (9 + LGH_SORT_PASSES + LGH_EXPONENTS))

#endif
