// Pictures of a rendered frame: reads images of the frame graph back and writes them as PNG and OpenEXR.
#include "lanternfield.h"

#include "modules/image_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct float_image {
    uint32_t width, height;
    float *texels; // RGBA
} float_image;

// ---- Read-back

static void half_decode(const void *texel, float rgba[4])
{
    _Float16 halfs[4];
    memcpy(halfs, texel, sizeof(halfs));
    for (int c = 0; c < 4; c++) {
        rgba[c] = (float)halfs[c];
    }
}

static void unorm16_decode(const void *texel, float rgba[4])
{
    uint16_t values[4];
    memcpy(values, texel, sizeof(values));
    for (int c = 0; c < 4; c++) {
        rgba[c] = (float)values[c] / 65535;
    }
}

static void snorm16_decode(const void *texel, float rgba[4])
{
    int16_t values[4];
    memcpy(values, texel, sizeof(values));
    for (int c = 0; c < 4; c++) {
        rgba[c] = fmaxf((float)values[c] / 32767, -1);
    }
}

static void float4_decode(const void *texel, float rgba[4])
{
    memcpy(rgba, texel, 4 * sizeof(float));
}

static void float1_decode(const void *texel, float rgba[4])
{
    float value;
    memcpy(&value, texel, sizeof(value));
    memcpy(rgba, (float[4]){value, value, value, 1}, 4 * sizeof(float));
}

// The formats of the images that the renderer names in renderer.h.
static void (*decoder_of(VkFormat format))(const void *, float[4])
{
    static const struct {
        VkFormat format;
        void (*decode)(const void *texel, float rgba[4]);
    } decoders[] = {
        {VK_FORMAT_R32G32B32A32_SFLOAT, float4_decode}, {VK_FORMAT_R32_SFLOAT, float1_decode},
        {VK_FORMAT_D32_SFLOAT, float1_decode},          {VK_FORMAT_R16G16B16A16_SFLOAT, half_decode},
        {VK_FORMAT_R16G16B16A16_UNORM, unorm16_decode}, {VK_FORMAT_R16G16B16A16_SNORM, snorm16_decode},
    };
    for (size_t i = 0; i < countof(decoders); i++) {
        if (decoders[i].format == format) {
            return decoders[i].decode;
        }
    }
    assert(!"a format that has no decoder");
    return NULL;
}

// The bytes of an exported image in its own format; free() them. NULL on failure (logged).
static uint8_t *image_bytes_read(renderer *r, gpu_image image)
{
    const gpu_image_desc *const info = gpu_image_info(r->gpu, image);
    const size_t size = (size_t)info->width * info->height * gpu_format_size(info->format);
    uint8_t *bytes = memory_alloc(size);
    // The renderer leaves its exports for transfer reads.
    if (!gpu_image_read(r->gpu, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, bytes, size)) {
        free(bytes);
        bytes = NULL;
    }
    return bytes;
}

// The texels are to be freed. False on failure (logged).
static bool image_read(renderer *r, const char *name, float_image *image)
{
    const gpu_image handle = frame_graph_find_image(r->graph, name);
    assert(handle.id && "aov_present says so");
    uint8_t *const bytes = image_bytes_read(r, handle);
    if (!bytes) {
        return false;
    }
    const gpu_image_desc *const info = gpu_image_info(r->gpu, handle);
    void (*const decode)(const void *, float[4]) = decoder_of(info->format);
    const size_t texel_size = gpu_format_size(info->format), count = (size_t)info->width * info->height;
    *image = (float_image){.width = info->width, .height = info->height};
    image->texels = memory_alloc(count * 4 * sizeof(float));
    for (size_t i = 0; i < count; i++) {
        decode(bytes + i * texel_size, image->texels + 4 * i);
    }
    free(bytes);
    return true;
}

// ---- From what the graph holds to what the file says

// Octahedral map (Cigolle et al. 2014), as in shaders/common.glsl.h.
static void octahedral_decode(const float encoded[2], float normal[3])
{
    const float z = 1 - fabsf(encoded[0]) - fabsf(encoded[1]);
    const float fold = fmaxf(-z, 0);
    const float x = encoded[0] + (encoded[0] >= 0 ? -fold : fold);
    const float y = encoded[1] + (encoded[1] >= 0 ? -fold : fold);
    const float length = sqrtf(x * x + y * y + z * z);
    normal[0] = x / length;
    normal[1] = y / length;
    normal[2] = z / length;
}

// Shading normals; zero where nothing was drawn.
static bool normals_finish(renderer *r, float_image *image)
{
    float_image depth;
    if (!image_read(r, "depth", &depth)) {
        return false;
    }
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        float *const texel = image->texels + 4 * i;
        float normal[3] = {0};
        if (depth.texels[4 * i] > 0) {
            octahedral_decode(texel + 2, normal);
        }
        memcpy(texel, normal, sizeof(normal));
    }
    free(depth.texels);
    return true;
}

// Metres along the view's axis.
static bool depth_finish(renderer *r, float_image *image)
{
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        float *const texel = image->texels + 4 * i;
        texel[0] = texel[0] > 0 ? r->constants.near_plane / texel[0] : 0;
    }
    return true;
}

// Interleaved images are tiled: pixel (x, y) lies in tile (x mod n, y mod n).
static bool untile_finish(renderer *r, float_image *image)
{
    const uint32_t n = r->settings.interleave, width = r->settings.width, height = r->settings.height;
    const uint32_t tile_width = div_up_u32(width, n), tile_height = div_up_u32(height, n);
    float *const texels = memory_alloc((size_t)width * height * 4 * sizeof(float));
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            const size_t tiled_x = x % n * tile_width + x / n, tiled_y = y % n * tile_height + y / n;
            memcpy(texels + ((size_t)y * width + x) * 4, image->texels + (tiled_y * image->width + tiled_x) * 4,
                   4 * sizeof(float));
        }
    }
    free(image->texels);
    *image = (float_image){.width = width, .height = height, .texels = texels};
    return true;
}

// ---- The parts of the picture

typedef struct aov_info {
    const char *name;
    const char *image; // in the frame graph
    uint32_t channels; // of the file
    bool (*finish)(renderer *r, float_image *image); // NULL: written as it is
    bool of_every_method; // false: of the lighting grid hierarchy's
} aov_info;

#define LIGHTS_PER_PIXEL "lights_per_pixel|-"

static const aov_info aovs[] = {
    {"albedo", "albedo", 3, NULL, true},
    {"normal", "normals", 3, normals_finish, true},
    {"depth", "depth", 1, depth_finish, true},
    {"direct", "aov_direct", 3, NULL, false},
    {"indirect", "aov_indirect", 3, NULL, false},
    {"shadow-u", "shadow_u_filtered|shadow_u|-", 3, NULL, false},
    {"shadow-s", "shadow_s_filtered|shadow_s|-", 3, NULL, false},
    {"shadow-ratio", "shadow_ratio|shadow_ratio_now|-", 3, NULL, false},
    {"lights-per-pixel", LIGHTS_PER_PIXEL, 1, untile_finish, false},
};

const aov_info *aov_find(const char *name)
{
    for (size_t i = 0; i < countof(aovs); i++) {
        if (strcmp(aovs[i].name, name) == 0) {
            return &aovs[i];
        }
    }
    return NULL;
}

void aov_names_print(char *text, size_t size)
{
    size_t length = 0;
    for (size_t i = 0; i < countof(aovs); i++) {
        length += (size_t)snprintf(text + length, size - length, "%s%s", i ? ", " : "", aovs[i].name);
        assert(length < size);
    }
}

const char *aov_name(const aov_info *aov)
{
    return aov->name;
}

bool aov_counts_lights(const aov_info *aov)
{
    return aov->finish == untile_finish;
}

bool aov_is_made_by(const aov_info *aov, uint32_t method)
{
    return method == METHOD_LGH || aov->of_every_method;
}

void export_add(renderer *r, const char *name)
{
    for (uint32_t i = 0; i < r->export_count; i++) {
        if (strcmp(r->exports[i], name) == 0) {
            return;
        }
    }
    assert(r->export_count < RENDERER_EXPORTS_MAX);
    r->exports[r->export_count++] = name;
}

void aov_export(renderer *r, const aov_info *aov)
{
    export_add(r, aov->image);
    if (aov->finish == normals_finish) {
        export_add(r, "depth");
    }
}

bool aov_present(const renderer *r, const aov_info *aov)
{
    return frame_graph_find_image(r->graph, aov->image).id != 0;
}

static bool exr_write(const char *path, const float_image *image, uint32_t channels)
{
    const size_t count = (size_t)image->width * image->height;
    float *const texels = memory_alloc(count * channels * sizeof(float));
    for (size_t i = 0; i < count; i++) {
        memcpy(texels + i * channels, image->texels + 4 * i, channels * sizeof(float));
    }
    const bool ok = image_write_exr(path, texels, image->width, image->height, channels);
    free(texels);
    return ok;
}

bool aov_write(renderer *r, const aov_info *aov, const char *path)
{
    float_image image;
    if (!image_read(r, aov->image, &image)) {
        return false;
    }
    const bool ok = (!aov->finish || aov->finish(r, &image)) && exr_write(path, &image, aov->channels);
    free(image.texels);
    return ok;
}

static bool display_write(renderer *r, const char *path)
{
    const gpu_image display = frame_graph_find_image(r->graph, "display");
    const gpu_image_desc *const info = gpu_image_info(r->gpu, display);
    uint8_t *const texels = image_bytes_read(r, display);
    if (!texels) {
        return false;
    }
    // Alpha is left out.
    for (size_t i = 0; i < (size_t)info->width * info->height; i++) {
        memmove(texels + 3 * i, texels + 4 * i, 3);
    }
    const bool ok = image_write_png(path, texels, info->width, info->height, 3);
    free(texels);
    return ok;
}

bool picture_write(renderer *r, const char *path)
{
    static const aov_info radiance = {"radiance", "radiance", 3, NULL, true};
    return path_has_extension(path, ".exr") ? aov_write(r, &radiance, path) : display_write(r, path);
}

double lights_per_pixel_mean(renderer *r)
{
    float_image lights, depth;
    if (!frame_graph_find_image(r->graph, LIGHTS_PER_PIXEL).id || !image_read(r, LIGHTS_PER_PIXEL, &lights)) {
        return -1;
    }
    double sum = 0, count = 0;
    untile_finish(r, &lights);
    if (image_read(r, "depth", &depth)) {
        for (size_t i = 0; i < (size_t)depth.width * depth.height; i++) {
            const bool drawn = depth.texels[4 * i] > 0;
            sum += drawn ? (double)lights.texels[4 * i] : 0;
            count += drawn;
        }
        free(depth.texels);
    }
    free(lights.texels);
    return count > 0 ? sum / count : -1;
}
