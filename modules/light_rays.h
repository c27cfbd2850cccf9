// Shadow rays that carry light. For each pixel a module makes some rays, and beside each the light that it brings to
// the pixel if nothing is in its way. They are traced in batches (rays.h), one or, where they do not fit, several in
// turn, and the light that arrives is summed up in an image:
//
//     light_rays rays = light_rays_begin(r, "shadow", "shadow_s", samples);
//     do {
//         frame_graph_pass *pass = ...;     // named rays.pass: "shadow/rays", then "shadow/2/rays", ...
//         light_rays_make(r, &rays, pass);  // the next three bindings: see shaders/light_rays.glsl.h
//     } while (light_rays_trace(r, &rays)); // adds "shadow/trace" and "shadow/sum"
//
// Each pass makes the layers [first, first + count) of `layers`: ray = (layer - first) * pixels + pixel. The sums are
// taken in the order of the layers, so that it does not show how many batches there are.
#pragma once

#include "resource_chain.h"
#include "renderer.h"

typedef struct light_rays {
    const char *name; // of the first batch; the next are "name/2", ...
    char pass[64];
    uint32_t layers; // rays a pixel
    uint32_t first, count; // layers of the current batch
    uint32_t batch, batches; // the current one's index, and how many there are
    resource_chain sum;
} light_rays;

// `layers` > 0. Adds no pass. The image `sum` is RGBA32F of the picture's size, its alpha zero.
light_rays light_rays_begin(const renderer *r, const char *name, const char *sum, uint32_t layers);
void light_rays_make(renderer *r, const light_rays *rays, frame_graph_pass *pass);
// Has the current batch traced and summed, and goes on to the next; false: that was the last.
bool light_rays_trace(renderer *r, light_rays *rays);
