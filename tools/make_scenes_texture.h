// Procedural textures that tile: each is a function of the place, from which a colour or a normal map is drawn.
#pragma once

#include "tools/make_scenes_gltf.h"

typedef struct texel {
    vec3 albedo; // linear
    float alpha;
    float height; // metres
} texel;
// At (u, v) in [0, 1), u to the right and v downwards; repeats with period 1.
typedef texel (*texture_recipe)(float u, float v);

// The comments give the metres one repeat is meant to cover.
texel texture_ashlar(float u, float v); // 1.6: blocks of 0.8 x 0.4 m
texel texture_brick(float u, float v); // 1
texel texture_limestone(float u, float v); // 1
texel texture_plaster(float u, float v); // 2
texel texture_paving(float u, float v); // 2.4: slabs of 0.6 m
texel texture_cobbles(float u, float v); // 1.2: setts of 0.15 m
texel texture_marble(float u, float v); // 1.2: checkers of 0.6 m
texel texture_wood(float u, float v); // 1: four planks, the grain along u
texel texture_cloth_red(float u, float v); // 0.8
texel texture_cloth_ochre(float u, float v);
texel texture_cloth_blue(float u, float v);
texel texture_awning_red(float u, float v); // 1.3: four stripes of each colour along v
texel texture_awning_blue(float u, float v);
texel texture_awning_ochre(float u, float v);
texel texture_leaves(float u, float v); // does not tile: a feathered frond in the left half, a broad leaf in the right

// What figures wear, laid out as make_scenes_figure.h has it.
texel texture_costume_waistcoat(float u, float v);
texel texture_costume_braces(float u, float v);
texel texture_costume_red_skirt(float u, float v);
texel texture_costume_blue_skirt(float u, float v);

// Draws 512 x 512 texels. With `has_alpha` the image is RGBA.
gltf_texture texture_add(gltf_file *file, const char *name, texture_recipe recipe, bool has_alpha);
// Draws the tangent-space normals of the recipe's heights, green up, where one repeat covers `repeat` metres.
gltf_texture texture_normals_add(gltf_file *file, const char *name, texture_recipe recipe, float repeat);
