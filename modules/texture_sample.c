// Wrapping and filtering as the samplers of world_upload.c have it.
#include "texture_sample.h"

#include <math.h>

enum { GL_NEAREST = 9728, GL_CLAMP_TO_EDGE = 33071, GL_MIRRORED_REPEAT = 33648 };

void texture_vertex_uv(const texture_reference *reference, const vertex_attributes *vertex, float uv[2])
{
    const float *from = reference->uv_set == 0 ? vertex->uv0 : vertex->uv1;
    const float *m = reference->transform;
    uv[0] = m[0] * from[0] + m[2] * from[1] + reference->offset[0];
    uv[1] = m[1] * from[0] + m[3] * from[1] + reference->offset[1];
}

// The same place in texels, within one period of the wrapping, so that it fits an integer; NaN becomes 0.
static float texel_coordinate(float u, uint32_t size, int wrap)
{
    const float period = wrap == GL_MIRRORED_REPEAT ? 2 : 1;
    const float place = wrap == GL_CLAMP_TO_EDGE ? u : u - period * floorf(u / period);
    return fminf(fmaxf(place, 0), period) * (float)size;
}

// `index` is at most one texel outside of the period that texel_coordinate gives.
static uint32_t texel_wrap(int64_t index, uint32_t size, int wrap)
{
    const int64_t last = (int64_t)size - 1;
    if (wrap == GL_CLAMP_TO_EDGE)
        return (uint32_t)(index < 0 ? 0 : index > last ? last : index);
    if (wrap == GL_MIRRORED_REPEAT)
        return (uint32_t)(index < 0 || index > 2 * last + 1 ? 0 : index > last ? 2 * last + 1 - index : index);
    return (uint32_t)(index < 0 ? last : index > last ? 0 : index);
}

static const uint8_t *texel_at(const scene_image *image, const scene_texture *texture, int64_t x, int64_t y)
{
    const uint32_t column = texel_wrap(x, image->width, texture->wrap_s);
    const uint32_t row = texel_wrap(y, image->height, texture->wrap_t);
    return &image->texels[4 * ((size_t)row * image->width + column)];
}

const uint8_t *texture_texel(const scene_data *scene, const scene_texture *texture, const float uv[2])
{
    const scene_image *image = &scene->images[texture->image];
    if (!image->texels)
        return NULL;
    const float x = texel_coordinate(uv[0], image->width, texture->wrap_s);
    const float y = texel_coordinate(uv[1], image->height, texture->wrap_t);
    return texel_at(image, texture, (int64_t)x, (int64_t)y);
}

// Weights of the four texels around the point, as in Vulkan's specification, "Texel Filtering".
static float alpha_linear(const scene_image *image, const scene_texture *texture, const float uv[2])
{
    const float x = texel_coordinate(uv[0], image->width, texture->wrap_s) - 0.5f;
    const float y = texel_coordinate(uv[1], image->height, texture->wrap_t) - 0.5f;
    const int64_t column = (int64_t)floorf(x), row = (int64_t)floorf(y);
    const float right = x - (float)column, below = y - (float)row;
    float alpha[2];
    for (int i = 0; i < 2; i++)
        alpha[i] = (1 - right) * (float)texel_at(image, texture, column, row + i)[3] +
                   right * (float)texel_at(image, texture, column + 1, row + i)[3];
    return ((1 - below) * alpha[0] + below * alpha[1]) / 255;
}

float texture_alpha(const scene_data *scene, const scene_texture *texture, const float uv[2])
{
    const scene_image *image = &scene->images[texture->image];
    if (!image->texels)
        return 1;
    return texture->mag_filter == GL_NEAREST ? (float)texture_texel(scene, texture, uv)[3] / 255
                                             : alpha_linear(image, texture, uv);
}
