// The pictures of report.html: a row a view, each with its difference to the reference, its FLIP map, or its lights per
// pixel as a heat map. They are inside the file, as PNG.
#include "lanternfield_bench_report.h"

#include "modules/image_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct picture { // linear radiance, RGB; no texels: not read
    float *texels;
    uint32_t width, height;
} picture;

static picture picture_read(report *r, const char *path)
{
    picture p = {0};
    p.texels = image_read_exr(path, &p.width, &p.height);
    r->failed |= !p.texels;
    return p;
}

// "data:..." of an 8-bit picture.
static void png_write(report *r, const char *name, const uint8_t *rgb, uint32_t width, uint32_t height)
{
    size_t size = 0;
    uint8_t *const bytes = image_png_encode(name, rgb, width, height, 3, &size);
    r->failed |= !bytes;
    fputs("data:image/png;base64,", r->out);
    report_base64_write(r->out, bytes, size);
    free(bytes);
}

static void image_write(report *r, const char *alt, const uint8_t *rgb, uint32_t width, uint32_t height)
{
    fprintf(r->out, "<img width=\"%u\" height=\"%u\" alt=\"", width, height);
    report_html_write(r->out, alt);
    fputs("\" src=\"", r->out);
    png_write(r, alt, rgb, width, height);
    fputs("\">", r->out);
}

// What the pictures of one view have in common.
typedef struct gallery {
    const bench_pictures *desc;
    const bench_view *view;
    picture reference; // the first one
    double ev; // NAN: each picture's own
    double lights_most; // end of the scale
} gallery;

static void tone_mapped_write(report *r, const gallery *g, const char *alt, const picture *p)
{
    const double ev = isnan(g->ev) ? image_exposure(p->texels, p->width, p->height) : g->ev;
    uint8_t *const rgb = memory_alloc((size_t)p->width * p->height * 3);
    image_tonemap(p->texels, p->width, p->height, ev, rgb);
    image_write(r, alt, rgb, p->width, p->height);
    free(rgb);
}

// Seconds where milliseconds are too many.
static const char *duration(report *r, double milliseconds)
{
    const bool long_time = milliseconds >= 1e4;
    return arena_printf(&r->memory, "%s %s", bench_number(&r->memory, long_time ? milliseconds / 1e3 : milliseconds),
                        long_time ? "s" : "ms");
}

typedef void color_map(float value, uint8_t rgb[3]);

// `values` times `factor` plus `offset` through a colour map.
static void map_write(report *r, const char *alt, const float *values, uint32_t width, uint32_t height, float factor,
                      float offset, color_map *map)
{
    const size_t count = (size_t)width * height;
    uint8_t *const rgb = memory_alloc(count * 3);
    for (size_t i = 0; i < count; i++) {
        map(values[i] * factor + offset, &rgb[3 * i]);
    }
    image_write(r, alt, rgb, width, height);
    free(rgb);
}

static void scale_bar_write(report *r, const char *low, const char *high, const char *what, color_map *map)
{
    enum { WIDTH = 160, HEIGHT = 10 };
    float ramp[WIDTH * HEIGHT];
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        ramp[i] = (float)(i % WIDTH) / (WIDTH - 1);
    }
    fprintf(r->out, "<p class=\"scale\">%s ", low);
    map_write(r, "scale", ramp, WIDTH, HEIGHT, 1, 0, map);
    fprintf(r->out, " %s &nbsp; ", high);
    report_html_write(r->out, what);
    fputs("</p>\n", r->out);
}

// ---- A row of pictures a view

// Differences of this many mean luminances of the reference and more have the darkest colours.
#define DIFFERENCE_MOST 0.5f

static bool shows(const gallery *g, const char *what)
{
    return strcmp(g->desc->what ? g->desc->what : "picture", what) == 0;
}

static bool gallery_wants(const bench_pictures *desc, const char *configuration)
{
    bool wanted = desc->configuration_count == 0;
    for (uint32_t i = 0; i < desc->configuration_count; i++) {
        wanted |= strcmp(desc->configurations[i], configuration) == 0;
    }
    return wanted;
}

// The caption's lines below the name.
static void caption_errors_write(report *r, const gallery *g, const bench_row *row)
{
    const bench_suite *const suite = r->results->suite;
    const char *const measure = shows(g, "flip") ? "flip_mean" : "relative_l2";
    for (uint32_t i = 0; i < suite->reference_count; i++) {
        const char *const metric = arena_printf(&r->memory, "%s.%s", suite->references[i].name, measure);
        fputs("<br>", r->out);
        report_html_write(r->out, bench_metric_title(&r->memory, metric));
        fprintf(r->out, " %s", bench_number(&r->memory, bench_metric(r->results, row, metric)));
    }
}

static void maps_write(report *r, const gallery *g, const picture *p)
{
    if (!g->reference.texels) {
        return;
    }
    if (p->width != g->reference.width || p->height != g->reference.height) {
        fputs("<p>another size than the reference</p>", r->out);
        return;
    }
    const size_t size = (size_t)p->width * p->height * sizeof(float);
    image_maps maps = {.flip = memory_alloc(size), .difference = memory_alloc(size)};
    if (!image_measure(p->texels, g->reference.texels, p->width, p->height, g->ev, NULL, &maps)) {
        r->failed = true;
    } else if (shows(g, "flip")) {
        map_write(r, "FLIP", maps.flip, p->width, p->height, 1, 0, color_map_sequential);
    } else {
        map_write(r, "difference", maps.difference, p->width, p->height, 0.5f / DIFFERENCE_MOST, 0.5f,
                  color_map_diverging);
    }
    free(maps.flip);
    free(maps.difference);
}

static void picture_figure_write(report *r, const gallery *g, const bench_row *row)
{
    picture p = picture_read(r, report_path(r, row->image));
    if (!p.texels) {
        return;
    }
    fputs("<figure><div class=\"over\">", r->out);
    tone_mapped_write(r, g, row->configuration->name, &p);
    fputs("</div>", r->out);
    maps_write(r, g, &p);
    fputs("<figcaption><b>", r->out);
    report_html_write(r->out, row->configuration->name);
    fprintf(r->out, "</b><br>%s", duration(r, row->picture_ms));
    caption_errors_write(r, g, row);
    fputs("</figcaption></figure>\n", r->out);
    free(p.texels);
}

static void lights_figure_write(report *r, const gallery *g, const bench_row *row)
{
    picture p = picture_read(r, report_path(r, row->lights_image));
    if (!p.texels) {
        return;
    }
    const size_t count = (size_t)p.width * p.height;
    for (size_t i = 0; i < count; i++) {
        p.texels[i] = p.texels[3 * i];
    }
    fputs("<figure>", r->out);
    map_write(r, row->configuration->name, p.texels, p.width, p.height, (float)(1 / g->lights_most), 0,
              color_map_sequential);
    fputs("<figcaption><b>", r->out);
    report_html_write(r->out, row->configuration->name);
    fprintf(r->out, "</b><br>%s lights per pixel<br>%s</figcaption></figure>\n",
            bench_number(&r->memory, row->lights_per_pixel), duration(r, row->picture_ms));
    free(p.texels);
}

static const char *reference_method(const bench_reference *reference)
{
    const char *method = "";
    for (uint32_t i = 0; i < reference->setting_count; i++) {
        method = strcmp(reference->settings[i].name, "method") == 0 ? reference->settings[i].value : method;
    }
    return method;
}

static void reference_figure_write(report *r, const gallery *g, const bench_reference_result *result)
{
    picture p = picture_read(r, result->image);
    if (!p.texels) {
        return;
    }
    const char *const method = reference_method(result->reference);
    const char *const unit = strcmp(method, "path") == 0  ? "samples per pixel"
                             : strcmp(method, "vpl") == 0 ? "VPL slots"
                                                          : "frames";
    fputs("<figure>", r->out);
    tone_mapped_write(r, g, result->reference->name, &p);
    fputs("<figcaption><b>reference: ", r->out);
    report_html_write(r->out, result->reference->name);
    fprintf(r->out, "</b><br>%s %s, %s", bench_number(&r->memory, (double)result->done), unit,
            duration(r, 1e3 * result->seconds));
    if (isfinite(result->error)) {
        fprintf(r->out, "<br>estimates its own relative error at %s %%", bench_number(&r->memory, 100 * result->error));
    }
    fputs("</figcaption></figure>\n", r->out);
    free(p.texels);
}

// The largest number of lights at a pixel of the row's pictures, rounded up to 1, 2 or 5 times a power of ten.
static double lights_scale(report *r, const gallery *g)
{
    float most = 1;
    for (uint32_t i = 0; i < r->results->row_count; i++) {
        const bench_row *const row = &r->results->rows[i];
        if (row->view != g->view || !row->done || !row->lights_image ||
            !gallery_wants(g->desc, row->configuration->name)) {
            continue;
        }
        picture p = picture_read(r, report_path(r, row->lights_image));
        for (size_t k = 0; p.texels && k < (size_t)p.width * p.height; k++) {
            most = fmaxf(most, p.texels[3 * k]);
        }
        free(p.texels);
    }
    const double power = pow(10, floor(log10((double)most))), digit = (double)most / power;
    return power * (digit <= 1 ? 1 : digit <= 2 ? 2 : digit <= 5 ? 5 : 10);
}

static void gallery_scale_write(report *r, const gallery *g)
{
    if (shows(g, "lights-per-pixel")) {
        scale_bar_write(r, "0", bench_number(&r->memory, g->lights_most), "lights per pixel", color_map_sequential);
    } else if (g->reference.texels && shows(g, "flip")) {
        scale_bar_write(r, "0", "1", "FLIP: difference as a viewer would see it", color_map_sequential);
    } else if (g->reference.texels) {
        const char *const most = arena_printf(&r->memory, "%g", (double)DIFFERENCE_MOST);
        scale_bar_write(r, arena_printf(&r->memory, "−%s", most), arena_printf(&r->memory, "+%s", most),
                        "luminance minus the reference's, over the mean of the reference", color_map_diverging);
    }
}

static void gallery_figures_write(report *r, const gallery *g)
{
    const bench_results *const results = r->results;
    const bool lights = shows(g, "lights-per-pixel");
    for (uint32_t i = 0; i < results->reference_count && !lights; i++) {
        if (results->references[i].view == g->view && results->references[i].image) {
            reference_figure_write(r, g, &results->references[i]);
        }
    }
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        const bool wanted = row->view == g->view && row->done && gallery_wants(g->desc, row->configuration->name);
        if (wanted && lights && row->lights_image) {
            lights_figure_write(r, g, row);
        } else if (wanted && !lights && row->image) {
            picture_figure_write(r, g, row);
        }
    }
}

static bool gallery_is_empty(const report *r, const bench_pictures *desc, const bench_view *view)
{
    bool empty = true;
    for (uint32_t i = 0; i < r->results->row_count; i++) {
        const bench_row *const row = &r->results->rows[i];
        empty &= row->view != view || !row->done || !gallery_wants(desc, row->configuration->name);
    }
    return empty;
}

static picture reference_read(report *r, const bench_view *view)
{
    for (uint32_t i = 0; i < r->results->reference_count; i++) {
        const bench_reference_result *const result = &r->results->references[i];
        if (result->view == view && result->reference == &r->results->suite->references[0] && result->image) {
            return picture_read(r, result->image);
        }
    }
    return (picture){0};
}

// The reference lies behind each picture, which gives way while the pointer is on it.
static void gallery_open(report *r, const gallery *g)
{
    const picture *const p = &g->reference;
    if (!p->texels || shows(g, "lights-per-pixel")) {
        fputs("<div class=\"row\">\n", r->out);
        return;
    }
    uint8_t *const rgb = memory_alloc((size_t)p->width * p->height * 3);
    image_tonemap(p->texels, p->width, p->height, g->ev, rgb);
    fputs("<div class=\"row compared\" style=\"--reference:url(", r->out);
    png_write(r, "reference", rgb, p->width, p->height);
    fputs(")\">\n", r->out);
    free(rgb);
}

static void gallery_write(report *r, const bench_pictures *desc, const bench_view *view)
{
    gallery g = {.desc = desc, .view = view, .reference = reference_read(r, view)};
    const picture *const p = &g.reference;
    g.ev = !view->settings.auto_exposure ? (double)view->settings.exposure
           : p->texels                   ? image_exposure(p->texels, p->width, p->height)
                                         : NAN;
    if (shows(&g, "lights-per-pixel")) {
        g.lights_most = lights_scale(r, &g);
    }
    report_heading_write(r, 3, view->name);
    gallery_scale_write(r, &g);
    gallery_open(r, &g);
    gallery_figures_write(r, &g);
    fputs("</div>\n", r->out);
    free(g.reference.texels);
}

void report_pictures_write(report *r)
{
    const bench_suite *const suite = r->results->suite;
    for (uint32_t i = 0; i < suite->picture_count; i++) {
        report_heading_write(r, 2, suite->pictures[i].title);
        for (uint32_t v = 0; v < suite->view_count; v++) {
            if (!gallery_is_empty(r, &suite->pictures[i], &suite->views[v])) {
                gallery_write(r, &suite->pictures[i], &suite->views[v]);
            }
        }
    }
}
