// The renderer: a world of entities (nodes, lights, passes), the scene on the GPU, and a frame graph rebuilt each frame
// from the pass entities. An engine embeds it like this:
//
//     gpu *gpu = gpu_create(&(gpu_desc){0});
//     scene_data *scene = scene_load("sponza.gltf");
//     renderer *r = renderer_create(gpu, scene, &settings);
//     r->camera = renderer_camera_of_scene(r, 0);
//     renderer_frame(r); // until it is good enough
//     gpu_image radiance = frame_graph_find_image(r->graph, "radiance");
//
// Names in the frame graph (images are width x height unless said otherwise; light is "radiance over albedo": what a
// white Lambertian surface would send out, in nits, so that radiance = albedo * light):
//
//   positions, attributes, previous_positions  buffers of the scene set, where it deforms meshes: see deform.h  deform
//   tlas               acceleration  the scene, for ray queries                        acceleration
//   vpls               vpl[slots]    see renderer_slots              vpl_trace; vpl_reference where it keeps them
//   lgh_header         lgh_header                                                      lgh_build
//   lgh_lights         grid_light[]  merged, top level first                           lgh_build
//   lgh_sums           lgh_sums[]    the same order; with lgh_masks, lgh_ranks, lgh_vertices: see shaders/lgh.glsl.h
//   lgh_keys, lgh_order  uint[]      the VPLs sorted by cell; with lgh_cell_*: see modules/lgh_buffers.h
//   lgh_samples        uvec4[]       choices on the way from each light to one of its VPLs; for the `vpl` end points
//   depth              D32           near/distance, 0 where nothing was drawn          gbuffer
//   normals            RGBA16_SNORM  octahedral: xy geometric, zw shading, both towards the viewer
//   albedo             RGBA16_UNORM  linear; a: which instance it is, see world_identity; 0 where nothing was drawn
//   emission           RGBA32F       nits
//   motion             RG16F         pixels from this frame's position to last frame's
//   direct             RGBA32F       light of the punctual lights that are shadowed one by one   direct_light
//   direct_u, direct_s RGBA32F       unshadowed and shadowed estimate of sampled direct light, where there is any
//   direct_analytic    RGBA32F       its unshadowed light without noise, where that is known
//   indirect           RGBA32F       unshadowed, of VPLs and the point lights among them (renderer_light_slots); a: sum
//                                    of the weights f; tiled when interleaved
//                                    (by light_gather or light_volume, like the next two)
//   lights_per_pixel   R32F          lights with a non-zero blending function; tiled like `indirect`
//   reservoirs         buffer        shadow samples a pixel: uint[k + 1], a sum's bits and k lights; light_volume's
//                                    exact ones: uint64_t[k], key and light
//   gather_*                         light lists: see shaders/light_gather.glsl.h                light_gather
//   indirect_gathered  RGBA32F       `indirect` over the tiles; only when interleaved                    interleave
//   shadow_u, shadow_s RGBA32F       unshadowed and shadowed estimate of indirect light          shadow
//                                    U.a: 1 where the pixel has light but no sample in this frame, else 0
//   shadow_plan        uint[pixels]  for the ray budget, with shadow_budget: see shadow_budget.glsl.h  shadow
//   filter_geometry    RGBA32F       shading normal and view depth, 0 where nothing is; for filters  svgf
//   X_u_filtered, X_s_filtered       for X = shadow, direct; made when somebody reads them   svgf
//   X_ratio_now        RGBA16F       S / U in [0,1]; a: standard deviation left        svgf; taa where unfiltered
//   X_ratio            RGBA16F       the same after TAA, where it is on; a: frames     taa
//   shadow_steadied    RGBA32F       with --taa light, in place of shadow_ratio: light after shadows and TAA; a: frames
//   shadow_records, shadow_lag, shadow_limit  where the history holds: see modules/shadow_again.h    shadow_again
//   radiance           RGBA32F       nits                    composite; progressive for the other methods
//   aov_direct, aov_indirect  RGBA32F  their parts of `radiance`, when exported, lgh alone  composite
//   sums_before, sums  vec4[2][pixels]  the references' light before and after this frame; see progressive.h
//   progressive_error  vec2[]        what their estimated error needs, a pair a workgroup            progressive
//   black, white       1x1           stand in for what is absent: read min(pixel, textureSize - 1)  composite
//   exposure           float         factor before the tone curve                      tonemap
//   display            RGBA8         tone-mapped sRGB                                  tonemap
//   rays_vpl, rays_direct, rays_shadow, rays_path  uint   of this frame, counted by the pass that makes them
//   X_origins, X_directions, X_visible, X_hits     buffers  batches of rays and their answers; see rays.h
//   X_estimates        vec3[rays]    the light that each ray of a batch brings, if nothing is in its way  light_rays
//   probes             probe[]       see modules/probe.h                               probe
//   vpl_flux           vec3[paths]   of the traced light paths at their last hit                      vpl_trace
//   vpl_changed        uint[]        a bit a slot, where not all VPLs are traced anew; see vpl_trace.h  vpl_trace
//   vpl_slot_lights    uint[]        light of each light slot, or LIGHT_SLOT_EMPTY                     vpl_trace
//   vpl_mask, vpl_list bits and numbers of the paths that are; vpl_shares, vpl_sources, vpl_elements: see
//   shaders/shared.h
#pragma once

#include "engine/ecs.h"
#include "engine/frame_graph.h"
#include "engine/gpu.h"
#include "scene.h"
#include "settings.h"

typedef struct render_camera {
    float eye[3], target[3], up[3]; // world; `up` need not be orthogonal
    float yfov; // radians
    float near_plane; // metres, > 0
} render_camera;

enum { RENDERER_EXPORTS_MAX = 16 };

typedef struct renderer {
    gpu *gpu;
    ecs_world *world;
    frame_graph *graph;
    const scene_data *scene;
    render_settings settings; // may be changed between frames
    render_camera camera; // may be changed between frames
    bool count_lights; // makes `lights_per_pixel`
    uint32_t gather_entries; // entries of light_gather's lists at most; 0: 4,194,304
    bool probes; // makes `probes`, also without automatic settings
    // Names kept beside "radiance" and "display" for frame_graph_find_*, left for transfer reads; "name|-" may be
    // absent.
    const char *exports[RENDERER_EXPORTS_MAX];
    uint32_t export_count;
    frame_constants constants; // of the current frame, as the shaders see them
    component_type pass; // render_pass
    component_type pass_state; // what renderer_pass_add keeps of a pass, switched on or off
    struct world_gpu *gpu_world; // modules/world.c
    struct animation_state *animation; // modules/animation_system.c
    double time; // seconds, of the next frame, by the clock of its animations; may be changed between frames
    uint32_t frame; // number of frames rendered so far
    uint32_t still_frames; // how many frames in a row, up to this one, show what the frame before showed
    uint32_t steady_frames; // how many have light, surfaces and settings of the one before; the first: STILL_SAMPLES
    render_settings last_settings; // the last frame's
    double milliseconds; // that the last frame took, by the clock
    bool failed; // in the current frame; systems set it after logging why
} renderer;

// The renderer keeps references to `gpu` and `scene`, which must outlive it. NULL on failure (logged).
renderer *renderer_create(gpu *gpu, const scene_data *scene, const render_settings *settings);
void renderer_destroy(renderer *r); // accepts NULL
// Runs the world's systems once: one frame. False when the device or a declaration failed (logged).
bool renderer_frame(renderer *r);

// A camera of the scene, where its node is now, or with SCENE_NONE one that frames the whole scene at rest.
render_camera renderer_camera_of_scene(const renderer *r, uint32_t camera);

// ---- For modules. A pass is an entity with a `render_pass` component and a component for its own state. Removing the
// render_pass component switches the pass off.
typedef struct render_pass {
    const char *name;
    void (*setup)(renderer *r, void *state); // declares frame graph passes; called every frame
    void *state;
} render_pass;

// Adds a pass whose state is `state_size` zeroed bytes; `fini` (may be NULL) releases what the state holds.
// Returns the state, which stays where it is for the renderer's life.
void *renderer_pass_add(renderer *r, const char *name, size_t state_size, void (*setup)(renderer *r, void *state),
                        void (*fini)(renderer *r, void *state));
entity renderer_pass_find(const renderer *r, const char *name); // {0} when there is none
// An entity's id as if there were no passes, whose entities lie between the scene's and those that came later: a pass
// more or less must not change random numbers.
uint32_t renderer_entity_key(const renderer *r, entity e);

// What several modules need to know of the current frame.
bool renderer_has_vpls(const renderer *r); // settings ask for indirect light by VPLs, and there are VPLs and lights
bool renderer_has_indirect(const renderer *r); // and the lighting grid hierarchy gathers them
uint32_t renderer_vpl_slots(const renderer *r); // settings' vpls, or ir_vpls
// Behind them, where more than settings' many_lights point lights are in the scene: slots for these. They have the
// normal 0 and radiate evenly, and their light, direct though it is, is in `indirect` and what is made of it. Only
// where the whole light is rendered: --only, `vpl` and `path` know direct light as such.
uint32_t renderer_light_slots(const renderer *r);
uint32_t renderer_slots(const renderer *r); // both
bool renderer_has_shadows(const renderer *r); // indirect light with shadow samples
// The picture has been still for so long that its history is full: no samples are taken any more, and each frame is the
// one before to the bit. STILL_SAMPLES a pixel are behind it.
enum { STILL_SAMPLES = 64 };
bool renderer_is_settled(const renderer *r);
// b in metres: no light's singularity is closer than this.
float renderer_singularity(const renderer *r);
