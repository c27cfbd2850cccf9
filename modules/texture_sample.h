// Textures read on the CPU, as the scene's samplers read mip 0: for light sources and for alpha masks.
#pragma once

#include "scene.h"

// The coordinates that `reference` reads at a vertex: its uv set and KHR_texture_transform.
void texture_vertex_uv(const texture_reference *reference, const vertex_attributes *vertex, float uv[2]);

// The RGBA8 texel that holds the point, after wrapping. NULL where the texture's image could not be read.
const uint8_t *texture_texel(const scene_data *scene, const scene_texture *texture, const float uv[2]);

// Alpha in [0,1] by the texture's magnification filter; 1 where its image could not be read.
float texture_alpha(const scene_data *scene, const scene_texture *texture, const float uv[2]);
