// Procedural textures that tile; see the header.
#include "tools/make_scenes_texture.h"
#include "tools/make_scenes_figure.h"

#include <math.h>
#include <stdlib.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

enum { SIZE = 512 };
static const float pi = 3.14159265358979f;

static float clamp01(float x)
{
    return fminf(fmaxf(x, 0), 1);
}

static float mix(float a, float b, float t)
{
    return a + (b - a) * t;
}

static vec3 mix3(vec3 a, vec3 b, float t)
{
    return vec3_add(vec3_scale(a, 1 - t), vec3_scale(b, t));
}

static float smooth(float low, float high, float x)
{
    const float t = clamp01((x - low) / (high - low));
    return t * t * (3 - 2 * t);
}

static float fract(float x)
{
    return x - floorf(x);
}

static int wrap(int i, int period)
{
    return (i % period + period) % period;
}

// Uniform in [0, 1).
static float lattice(int x, int y, uint32_t seed)
{
    random_sequence sequence = {(uint64_t)(uint32_t)x << 40 ^ (uint64_t)(uint32_t)y << 16 ^ seed};
    random_uniform(&sequence, 0, 1);
    sequence.state ^= sequence.state >> 29;
    random_uniform(&sequence, 0, 1);
    return random_uniform(&sequence, 0, 1);
}

// Value noise in [0, 1] over a lattice of columns x rows cells, periodic.
static float noise(float u, float v, int columns, int rows, uint32_t seed)
{
    const float x = u * (float)columns, y = v * (float)rows;
    const int x0 = wrap((int)floorf(x), columns), y0 = wrap((int)floorf(y), rows);
    const int x1 = wrap(x0 + 1, columns), y1 = wrap(y0 + 1, rows);
    const float tx = smooth(0, 1, fract(x)), ty = smooth(0, 1, fract(y));
    return mix(mix(lattice(x0, y0, seed), lattice(x1, y0, seed), tx),
               mix(lattice(x0, y1, seed), lattice(x1, y1, seed), tx), ty);
}

// Four or so octaves of noise, in about [-1, 1].
static float fractal_noise(float u, float v, int cells, int octaves, uint32_t seed)
{
    float sum = 0, amplitude = 1;
    for (int i = 0; i < octaves; i++, cells *= 2, amplitude /= 2)
        sum += amplitude * (noise(u, v, cells, cells, seed + (uint32_t)i) - 0.5f);
    return sum;
}

typedef struct masonry_place {
    float edge; // metres to the nearest edge of the block
    float tone; // uniform in [0, 1), its own for each block
    int column, row;
} masonry_place;

// Courses of blocks, every second one moved by `shift` of a block; one repeat covers `repeat` metres.
static masonry_place masonry(float u, float v, int columns, int rows, float shift, float repeat, uint32_t seed)
{
    const float y = v * (float)rows;
    const int row = wrap((int)floorf(y), rows);
    const float x = u * (float)columns + (row % 2 ? shift : 0);
    const int column = wrap((int)floorf(x), columns);
    const float side = fminf(fract(x), 1 - fract(x)) * repeat / (float)columns;
    const float end = fminf(fract(y), 1 - fract(y)) * repeat / (float)rows;
    return (masonry_place){fminf(side, end), lattice(column, row, seed), column, row};
}

texel texture_ashlar(float u, float v)
{
    const masonry_place place = masonry(u, v, 2, 4, 0.5f, 1.6f, 11);
    const float grain = fractal_noise(u, v, 32, 5, 12), stains = fractal_noise(u, v, 4, 3, 17);
    const float block = smooth(0.003f, 0.009f, place.edge + 0.002f * grain);
    const vec3 pale = {0.60f, 0.52f, 0.40f}, dark = {0.50f, 0.40f, 0.29f}, mortar = {0.40f, 0.36f, 0.30f};
    const vec3 stone = vec3_scale(mix3(dark, pale, place.tone), 1 + 0.16f * grain + 0.10f * stains);
    return (texel){
        .albedo = mix3(mortar, stone, block),
        .height = 0.008f * smooth(0.002f, 0.018f, place.edge) + 0.003f * grain + 0.002f * place.tone,
    };
}

texel texture_brick(float u, float v)
{
    const masonry_place place = masonry(u, v, 4, 12, 0.5f, 1, 21);
    const float grain = fractal_noise(u, v, 48, 4, 22);
    const float block = smooth(0.004f, 0.008f, place.edge + 0.003f * grain);
    const vec3 pale = {0.46f, 0.24f, 0.15f}, dark = {0.28f, 0.12f, 0.08f}, mortar = {0.44f, 0.40f, 0.34f};
    const vec3 brick = vec3_scale(mix3(dark, pale, place.tone), 1 + 0.3f * grain);
    return (texel){
        .albedo = mix3(mortar, brick, block),
        .height = 0.006f * smooth(0.003f, 0.011f, place.edge) + 0.002f * grain + 0.002f * place.tone,
    };
}

texel texture_limestone(float u, float v)
{
    const float clouds = fractal_noise(u, v, 4, 4, 31), grain = fractal_noise(u, v, 64, 3, 32);
    return (texel){.albedo = vec3_scale((vec3){0.66f, 0.61f, 0.52f}, 1 + 0.12f * clouds + 0.08f * grain)};
}

texel texture_plaster(float u, float v)
{
    const float clouds = fractal_noise(u, v, 3, 5, 41), grain = fractal_noise(u, v, 64, 3, 42);
    return (texel){.albedo = vec3_scale((vec3){0.70f, 0.66f, 0.59f}, 1 + 0.10f * clouds + 0.05f * grain)};
}

texel texture_paving(float u, float v)
{
    const masonry_place place = masonry(u, v, 4, 4, 0, 2.4f, 51);
    const float clouds = fractal_noise(u, v, 8, 5, 52), grain = fractal_noise(u, v, 64, 3, 53);
    const float slab = smooth(0.003f, 0.008f, place.edge);
    const vec3 warm = {0.53f, 0.46f, 0.36f}, grey = {0.42f, 0.40f, 0.36f}, joint = {0.22f, 0.20f, 0.17f};
    const bool checker = (place.column + place.row) % 2;
    const vec3 stone = vec3_scale(checker ? warm : grey, 0.9f + 0.2f * place.tone + 0.18f * clouds + 0.08f * grain);
    return (texel){
        .albedo = mix3(joint, stone, slab),
        .height = 0.004f * smooth(0.002f, 0.012f, place.edge) + 0.0015f * clouds,
    };
}

texel texture_cobbles(float u, float v)
{
    const float bend = 0.012f * fractal_noise(u, v, 6, 3, 55);
    const masonry_place place = masonry(u + bend, v - bend, 8, 8, 0.5f, 1.2f, 56);
    const float clouds = fractal_noise(u, v, 8, 5, 57), grain = fractal_noise(u, v, 64, 3, 58);
    const float sett = smooth(0.006f, 0.016f, place.edge + 0.003f * grain);
    const vec3 warm = {0.30f, 0.26f, 0.21f}, grey = {0.21f, 0.21f, 0.22f}, joint = {0.08f, 0.07f, 0.06f};
    const vec3 stone = vec3_scale(mix3(grey, warm, place.tone), 1 + 0.2f * clouds + 0.15f * grain);
    return (texel){
        .albedo = mix3(joint, stone, sett),
        .height = 0.02f * smooth(0, 0.06f, place.edge) + 0.002f * grain + 0.004f * place.tone,
    };
}

texel texture_marble(float u, float v)
{
    const masonry_place place = masonry(u, v, 2, 2, 0, 1.2f, 61);
    // Veins lie where a warped noise crosses its middle; every tile has its own.
    const float shift = place.tone;
    const float warp = 0.25f * fractal_noise(u + shift, v, 4, 4, 62);
    const float ridge = fabsf(fractal_noise(u + warp, v + shift + warp, 3, 4, 63));
    const float vein = 1 - smooth(0, 0.09f, ridge), clouds = fractal_noise(u, v + shift, 5, 4, 64);
    const bool is_dark = (place.column + place.row) % 2;
    const vec3 light = mix3((vec3){0.70f, 0.66f, 0.59f}, (vec3){0.46f, 0.42f, 0.37f}, 0.7f * vein);
    const vec3 dark = mix3((vec3){0.13f, 0.10f, 0.09f}, (vec3){0.38f, 0.30f, 0.24f}, 0.6f * vein);
    const vec3 stone = vec3_scale(is_dark ? dark : light, 1 + 0.10f * clouds);
    return (texel){.albedo = mix3((vec3){0.24f, 0.21f, 0.18f}, stone, smooth(0.001f, 0.004f, place.edge))};
}

texel texture_wood(float u, float v)
{
    const masonry_place plank = masonry(u, v, 1, 4, 0.5f, 1, 71);
    const float rings = noise(u + plank.tone, v, 3, 40, 72) + 0.5f * noise(u, v, 6, 96, 73) - 0.75f;
    const float fibres = noise(u, v, 16, 256, 74) - 0.5f;
    const float gap = smooth(0.001f, 0.004f, fminf(fract(v * 4), 1 - fract(v * 4)) / 4);
    const float tone = 0.8f + 0.35f * plank.tone + 0.45f * rings + 0.2f * fibres;
    return (texel){.albedo = vec3_scale((vec3){0.34f, 0.21f, 0.12f}, tone * mix(0.35f, 1, gap))};
}

// A plain weave with a woven border of lozenges between pairs of stripes.
static texel cloth(float u, float v, vec3 ground, vec3 figure, uint32_t seed)
{
    enum { THREADS = 96 };
    const float x = u * THREADS, y = v * THREADS;
    const bool warp_on_top = ((int)floorf(x) + (int)floorf(y)) % 2;
    const float bulge =
        warp_on_top ? sinf(pi * fract(y)) * sinf(pi * fract(x)) : sinf(pi * fract(x)) * sinf(pi * fract(y));
    const float slub = noise(u, v, THREADS, 6, seed) + noise(u, v, 6, THREADS, seed + 1) - 1;

    // The figure follows whole threads.
    const float fx = fract(floorf(x) / THREADS * 4) - 0.5f, fy = fract(floorf(y) / THREADS * 2) - 0.5f;
    const float lozenge = fabsf(fx) / 0.42f + fabsf(fy) / 0.30f;
    const bool is_lozenge = (lozenge < 1 && lozenge > 0.72f) || lozenge < 0.32f;
    const bool is_stripe = (fabsf(fy) > 0.36f && fabsf(fy) < 0.40f) || (fabsf(fy) > 0.43f && fabsf(fy) < 0.45f);
    const vec3 dye = is_lozenge || is_stripe ? figure : ground;
    return (texel){.albedo = vec3_scale(dye, 0.82f + 0.22f * bulge + (warp_on_top ? 0.06f : 0) + 0.15f * slub)};
}

texel texture_cloth_red(float u, float v)
{
    return cloth(u, v, (vec3){0.50f, 0.055f, 0.045f}, (vec3){0.60f, 0.34f, 0.10f}, 81);
}

texel texture_cloth_ochre(float u, float v)
{
    return cloth(u, v, (vec3){0.64f, 0.38f, 0.09f}, (vec3){0.40f, 0.10f, 0.05f}, 83);
}

texel texture_cloth_blue(float u, float v)
{
    return cloth(u, v, (vec3){0.06f, 0.13f, 0.40f}, (vec3){0.55f, 0.50f, 0.38f}, 85);
}

// Broad stripes along v of a coarse weave.
static texel awning(float u, float v, vec3 dye, uint32_t seed)
{
    const vec3 linen = {0.70f, 0.63f, 0.50f};
    const float weave = noise(u, v, 128, 16, seed) + noise(u, v, 16, 128, seed + 1) - 1;
    const float faded = fractal_noise(u, v, 3, 4, seed + 2), stripe = fract(4 * u);
    const vec3 color = stripe < 0.5f ? dye : linen;
    return (texel){.albedo = vec3_scale(color, 0.95f + 0.12f * weave + 0.12f * faded)};
}

texel texture_awning_red(float u, float v)
{
    return awning(u, v, (vec3){0.52f, 0.07f, 0.05f}, 101);
}

texel texture_awning_blue(float u, float v)
{
    return awning(u, v, (vec3){0.07f, 0.15f, 0.36f}, 104);
}

texel texture_awning_ochre(float u, float v)
{
    return awning(u, v, (vec3){0.60f, 0.36f, 0.08f}, 107);
}

// Leaflets on both sides of a rib, longest at a third of the way; x in [-1, 1] across, y in [0, 1] from stalk to tip.
static texel frond(float x, float y)
{
    enum { LEAFLETS = 15 };
    const float away = fabsf(x), reach = 0.98f * powf(sinf(pi * powf(clamp01(0.06f + 0.94f * y), 0.6f)), 0.6f);
    // Leaflets point forward: their row is found where they leave the rib.
    const float row = (y - 0.16f * away) * LEAFLETS + (x > 0 ? 0.5f : 0);
    const float across = fabsf(fract(row) - 0.5f) * 2;
    const float taper = 0.86f * sqrtf(clamp01(1 - away / fmaxf(reach, 1e-3f)));
    const bool is_rib = away < 0.035f * (1.3f - y);
    const bool is_leaflet = row > 0 && y < 0.985f && away < reach && across < taper;
    const float tone = 0.75f + 0.35f * lattice((int)floorf(row), x > 0, 91) + 0.25f * (1 - across);
    return (texel){
        .albedo = is_rib ? (vec3){0.22f, 0.25f, 0.09f} : vec3_scale((vec3){0.11f, 0.22f, 0.06f}, tone),
        .alpha = is_rib || is_leaflet ? 1 : 0,
    };
}

static texel broad_leaf(float x, float y)
{
    const float away = fabsf(x), reach = 0.94f * powf(sinf(pi * powf(y, 0.75f)), 0.8f);
    const float vein = fabsf(fract((y - 0.25f * away) * 9) - 0.5f) * 2;
    const bool is_rib = away < 0.04f * (1.3f - y), is_leaf = away < reach && y < 0.99f;
    const float light = 1 - 0.35f * smooth(0.85f, 1, vein) + 0.5f * fractal_noise(x / 2, y, 8, 3, 92);
    return (texel){
        .albedo = is_rib ? (vec3){0.26f, 0.30f, 0.12f} : vec3_scale((vec3){0.12f, 0.25f, 0.09f}, light),
        .alpha = is_rib || is_leaf ? 1 : 0,
    };
}

texel texture_leaves(float u, float v)
{
    const float half = fract(2 * u) * 2 - 1;
    return u < 0.5f ? frond(half, 1 - v) : broad_leaf(half, 1 - v);
}

// ---- Costumes. Places are metres of the figure at rest, seen from in front.

typedef struct costume {
    vec3 skin, hair, shirt, over_shirt, lower, trim, shoes;
    bool waistcoat, braces, skirt;
    uint32_t seed;
} costume;

// 1 within `half` of zero, with an edge of `blur`.
static float band(float x, float half, float blur)
{
    return 1 - smooth(half - blur / 2, half + blur / 2, fabsf(x));
}

static vec3 face_paint(const costume *costume, float x, float y)
{
    const float side = fabsf(x);
    const float blush = expf(-((side - 0.05f) * (side - 0.05f) + (y - 1.61f) * (y - 1.61f)) / 0.0006f);
    vec3 paint =
        mix3(costume->skin, (vec3){costume->skin.x, 0.6f * costume->skin.y, 0.55f * costume->skin.z}, 0.35f * blush);
    const float lips = band(y - 1.577f - 0.1f * side, 0.0065f * clamp01(1 - side / 0.03f), 0.004f);
    paint = mix3(paint, (vec3){0.9f * costume->skin.x, 0.45f * costume->skin.y, 0.42f * costume->skin.z},
                 lips * (side < 0.03f));
    const float ex = (side - 0.035f) / 0.0165f, ey = (y - 1.656f) / 0.0075f;
    const float white = 1 - smooth(0.75f, 1.1f, ex * ex + ey * ey);
    const float iris = 1 - smooth(0.0055f, 0.0075f, hypotf(side - 0.034f, y - 1.657f));
    const float lash = band(y - 1.6665f + 8 * (side - 0.035f) * (side - 0.035f), 0.0022f, 0.003f) *
                       band(side - 0.036f, 0.019f, 0.004f);
    const float brow =
        band(y - 1.682f + 6 * (side - 0.04f) * (side - 0.04f), 0.0035f, 0.004f) * band(side - 0.04f, 0.022f, 0.008f);
    paint = mix3(paint, (vec3){0.72f, 0.70f, 0.67f}, white);
    paint = mix3(paint, (vec3){0.05f, 0.035f, 0.025f}, fmaxf(white * iris, lash));
    paint = mix3(paint, vec3_scale(costume->hair, 0.8f), 0.85f * brow);
    // Hair on the forehead and at the temples.
    const float hairline = fmaxf(smooth(1.7f, 1.712f, y + 1.5f * x * x), smooth(0.072f, 0.078f, side) * (y > 1.62f));
    return mix3(paint, costume->hair, hairline);
}

static vec3 shirt_paint(const costume *costume, float x, float y)
{
    const float side = fabsf(x);
    const float placket = band(x, 0.012f, 0.004f), cuff = smooth(0.555f, 0.56f, side);
    vec3 paint = mix3(costume->shirt, vec3_scale(costume->shirt, 0.8f), placket);
    paint = mix3(paint, costume->trim, cuff);
    if (costume->waistcoat) {
        const float half = mix(0.185f, 0.125f, smooth(1.26f, 1.32f, y));
        const float cloth = (1 - smooth(half, half + 0.005f, side)) * (1 - smooth(1.4f, 1.405f, y));
        const float button = band(x, 0.007f, 0.003f) * band(fract(y / 0.06f) * 0.06f - 0.03f, 0.007f, 0.003f);
        paint = mix3(paint, mix3(costume->over_shirt, costume->trim, button), cloth);
    }
    if (costume->braces)
        paint = mix3(paint, costume->over_shirt, band(side - 0.085f, 0.018f, 0.004f));
    if (costume->skirt) // a bodice
        paint = mix3(paint, costume->over_shirt, (1 - smooth(0.185f, 0.19f, side)) * (1 - smooth(1.3f, 1.305f, y)));
    return paint;
}

static vec3 lower_paint(const costume *costume, float x, float y)
{
    const float belt = smooth(1.045f, 1.05f, y);
    if (!costume->skirt)
        return mix3(costume->lower, mix3(costume->shoes, costume->trim, band(x, 0.02f, 0.004f)), belt);
    const float ribbons = fmaxf(band(y - 0.47f, 0.012f, 0.004f), band(y - 0.53f, 0.025f, 0.004f));
    return mix3(costume->lower, costume->trim, fmaxf(ribbons, belt));
}

static texel costume_texel(const costume *costume, float u, float v)
{
    const int column = wrap((int)floorf(4 * u), 4), row = wrap((int)floorf(2 * v), 2);
    const figure_region region = (figure_region)(4 * row + column);
    if (region >= REGION_COUNT)
        return (texel){.albedo = costume->lower};
    const figure_rectangle cell = figure_cell(region);
    const float x = mix(cell.left, cell.right, fract(4 * u)), y = mix(cell.top, cell.bottom, fract(2 * v));
    vec3 paint = {0};
    float grain = 0.06f;
    switch (region) {
    case REGION_SKIN:
        paint = costume->skirt && y < 0.24f ? (vec3){0.7f, 0.68f, 0.64f} : costume->skin; // socks
        break;
    case REGION_FACE:
        paint = face_paint(costume, x, y);
        break;
    case REGION_HAIR:
        paint = costume->hair;
        grain = 0.5f;
        break;
    case REGION_SHIRT:
        paint = shirt_paint(costume, x, y);
        grain = 0.15f;
        break;
    case REGION_LOWER:
        paint = lower_paint(costume, x, y);
        grain = 0.2f;
        break;
    case REGION_SHOES:
        paint = costume->shoes;
        break;
    case REGION_COUNT:
        break;
    }
    return (texel){.albedo = vec3_scale(paint, 1 + grain * fractal_noise(u, v, 64, 3, costume->seed))};
}

texel texture_costume_waistcoat(float u, float v)
{
    static const costume costume = {.skin = {0.58f, 0.36f, 0.25f},
                                    .hair = {0.06f, 0.04f, 0.03f},
                                    .shirt = {0.72f, 0.70f, 0.65f},
                                    .over_shirt = {0.10f, 0.16f, 0.09f},
                                    .lower = {0.07f, 0.065f, 0.06f},
                                    .trim = {0.62f, 0.45f, 0.16f},
                                    .shoes = {0.05f, 0.03f, 0.02f},
                                    .waistcoat = true,
                                    .seed = 101};
    return costume_texel(&costume, u, v);
}

texel texture_costume_braces(float u, float v)
{
    static const costume costume = {.skin = {0.30f, 0.16f, 0.10f},
                                    .hair = {0.02f, 0.016f, 0.013f},
                                    .shirt = {0.30f, 0.42f, 0.55f},
                                    .over_shirt = {0.16f, 0.08f, 0.04f},
                                    .lower = {0.30f, 0.23f, 0.15f},
                                    .trim = {0.66f, 0.63f, 0.57f},
                                    .shoes = {0.12f, 0.06f, 0.03f},
                                    .braces = true,
                                    .seed = 103};
    return costume_texel(&costume, u, v);
}

texel texture_costume_red_skirt(float u, float v)
{
    static const costume costume = {.skin = {0.64f, 0.42f, 0.31f},
                                    .hair = {0.22f, 0.10f, 0.04f},
                                    .shirt = {0.74f, 0.72f, 0.67f},
                                    .over_shirt = {0.08f, 0.06f, 0.07f},
                                    .lower = {0.52f, 0.06f, 0.05f},
                                    .trim = {0.70f, 0.60f, 0.38f},
                                    .shoes = {0.06f, 0.03f, 0.025f},
                                    .skirt = true,
                                    .seed = 105};
    return costume_texel(&costume, u, v);
}

texel texture_costume_blue_skirt(float u, float v)
{
    static const costume costume = {.skin = {0.46f, 0.27f, 0.17f},
                                    .hair = {0.035f, 0.025f, 0.02f},
                                    .shirt = {0.72f, 0.55f, 0.20f},
                                    .over_shirt = {0.36f, 0.10f, 0.08f},
                                    .lower = {0.06f, 0.22f, 0.33f},
                                    .trim = {0.72f, 0.68f, 0.58f},
                                    .shoes = {0.10f, 0.05f, 0.03f},
                                    .skirt = true,
                                    .seed = 107};
    return costume_texel(&costume, u, v);
}

static uint8_t srgb_byte(float linear)
{
    const float x = clamp01(linear);
    const float encoded = x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
    return (uint8_t)(encoded * 255 + 0.5f);
}

static gltf_texture png_add(gltf_file *file, const char *name, const uint8_t *pixels, int channels)
{
    int size = 0;
    uint8_t *png = stbi_write_png_to_mem(pixels, SIZE * channels, SIZE, SIZE, channels, &size);
    const gltf_texture texture = gltf_texture_add(file, name, png, (size_t)size);
    free(png);
    return texture;
}

gltf_texture texture_add(gltf_file *file, const char *name, texture_recipe recipe, bool has_alpha)
{
    const size_t channels = has_alpha ? 4 : 3;
    uint8_t *pixels = memory_alloc(SIZE * SIZE * channels), *to = pixels;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++, to += channels) {
            const texel place = recipe(((float)x + 0.5f) / SIZE, ((float)y + 0.5f) / SIZE);
            to[0] = srgb_byte(place.albedo.x);
            to[1] = srgb_byte(place.albedo.y);
            to[2] = srgb_byte(place.albedo.z);
            if (has_alpha)
                to[3] = (uint8_t)(place.alpha * 255);
        }
    const gltf_texture texture = png_add(file, name, pixels, (int)channels);
    free(pixels);
    return texture;
}

gltf_texture texture_normals_add(gltf_file *file, const char *name, texture_recipe recipe, float repeat)
{
    float *heights = memory_alloc(SIZE * SIZE * sizeof *heights);
    for (int i = 0; i < SIZE * SIZE; i++)
        heights[i] = recipe(((float)(i % SIZE) + 0.5f) / SIZE, ((float)(i / SIZE) + 0.5f) / SIZE).height;

    uint8_t *pixels = memory_alloc(SIZE * SIZE * 3), *to = pixels;
    const float two_texels = 2 * repeat / SIZE;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++, to += 3) {
            const float right = heights[y * SIZE + wrap(x + 1, SIZE)], left = heights[y * SIZE + wrap(x - 1, SIZE)];
            const float below = heights[wrap(y + 1, SIZE) * SIZE + x], above = heights[wrap(y - 1, SIZE) * SIZE + x];
            const vec3 normal = vec3_normalize((vec3){(left - right) / two_texels, (below - above) / two_texels, 1});
            to[0] = (uint8_t)(127.5f + 127.5f * normal.x + 0.5f);
            to[1] = (uint8_t)(127.5f + 127.5f * normal.y + 0.5f);
            to[2] = (uint8_t)(127.5f + 127.5f * normal.z + 0.5f);
        }
    free(heights);
    const gltf_texture texture = png_add(file, name, pixels, 3);
    free(pixels);
    return texture;
}
