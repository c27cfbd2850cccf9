// Rays in batches: a pass of a module writes rays into two buffers, the tracing pass answers them, another pass of the
// module uses the answers. Who traces is decided here alone (--rays): ray query in a compute shader, a
// ray-tracing pipeline, or Embree on the CPU as a host pass.
//
//     const uint32_t count = r->settings.width * r->settings.height;
//     rays_create(r, pass, "shadow", count);               // in the pass that makes the rays: the next two bindings
//     rays_trace(r, "shadow", RAYS_VISIBLE, count);         // adds "shadow/order" and "shadow/trace", which makes
//                                                           // shadow_visible
//     frame_graph_read(next, "shadow_visible", ACCESS_STORAGE_READ);
//
// Resources of a batch X, each of `count` items (structs in shaders/shared.h, access from shaders in rays.glsl.h):
//   X_origins     vec4      origin, world; w: reach in metres along the direction, 1e30 for ever, <= 0: no ray
//   X_directions  vec4      unit direction; w: unused by the tracer, free for the module
//   X_visible     uint      RAYS_VISIBLE: 1 where nothing lies on the ray within its reach; undefined without a ray
//   X_hits        ray_hit   RAYS_NEAREST: instance RAY_MISS where nothing was hit, or there is no ray
//
//   X_order       uint      which rays to trace, those next to each other alike; absent ones are left out (but not of
//                           RAYS_NEAREST). On a GPU, and not with --no-ray-order
//   X_order_header          ray_order_header and RAY_ORDER_BUCKETS numbers of the pass "X/order" that makes both
//
// Answers lie at the ray's own index and do not depend on the order. All tracers respect alpha masks and see both
// sides of every triangle. They find the same hits but for rounding.
#pragma once

#include "renderer.h"

typedef enum rays_kind { RAYS_VISIBLE, RAYS_NEAREST } rays_kind;

// What one batch holds at most without being asked to be larger: 64 MiB a buffer.
enum { RAYS_BATCH = 1 << 22 };

// The tracer of this frame, never RAYS_AUTO: Embree where the device is a CPU, else ray query where the device has it,
// else pipelines.
ray_method rays_tracer(const renderer *r);
bool rays_are_host(const renderer *r); // Embree traces
void rays_create(renderer *r, frame_graph_pass *pass, const char *batch, uint32_t count);
// The same buffers, made by other hands: for a batch that several passes fill, `from` is renamed to `to`.
void rays_modify(renderer *r, frame_graph_pass *pass, const char *from, const char *to);
void rays_trace(renderer *r, const char *batch, rays_kind kind, uint32_t count);
// How many of `wanted` rays a pixel fit into one batch, at least one. Modules lay batches out in layers, ray = layer *
// pixels + pixel, and trace in several batches what does not fit.
uint32_t rays_layers(const renderer *r, uint32_t wanted);
