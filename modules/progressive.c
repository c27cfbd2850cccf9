// The sums of the progressive methods, the picture made from them, and their state in a file: see progressive.h.
#include "progressive.h"
#include "modules.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNTIL_SAMPLES_MIN = 16 }; // with fewer the estimate may not have seen what is rare and bright

typedef struct progressive {
    gpu_pipeline pipeline;
    gpu_buffer sums; // vec4[2][pixels]
    uint32_t width, height; // of `sums`
    uint64_t key; // hash of all that the sums depend on
    bool loaded; // the sums come from a file; the next frame's key becomes theirs
    uint64_t done, total;
    bool halves;
    double error; // of the last measure
    double rays;
    bool rays_pending; // the last frame's are not in `rays` yet
} progressive;

static progressive *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "progressive"), r->pass))->state;
}

bool progressive_is(const renderer *r)
{
    return r->settings.method == METHOD_PATH || r->settings.method == METHOD_VPL;
}

// ---- What the sums depend on

static const uint64_t HASH_START = 14695981039346656037u;

// FNV-1a, 64 bits (Fowler, Noll and Vo).
static uint64_t hash_add(uint64_t hash, const void *bytes, size_t size)
{
    const uint8_t *byte = bytes;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ byte[i]) * 1099511628211u;
    return hash;
}

static uint64_t settings_hash(uint64_t hash, const render_settings *settings)
{
    static const char *const without[] = {"spp", "until", "frames", "exposure", "rays"};
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        bool matters = true;
        for (size_t k = 0; k < countof(without); k++)
            matters = matters && strcmp(table[i].name, without[k]) != 0;
        char text[32];
        settings_get(settings, &table[i], text);
        hash = matters ? hash_add(hash, text, strlen(text) + 1) : hash;
    }
    return hash;
}

static uint64_t pose_hash(uint64_t hash, const renderer *r, uint32_t index)
{
    const scene_deformation *d = &r->scene->deformations[index];
    const world_deformation *now = &r->gpu_world->deformations[index];
    const uint32_t joints = d->skin == SCENE_NONE ? 0 : r->scene->skins[d->skin].joint_count;
    hash = hash_add(hash, now->joints, joints * sizeof *now->joints);
    return hash_add(hash, now->weights, d->target_count * sizeof *now->weights);
}

static uint64_t key_of(const renderer *r)
{
    const world_gpu *w = r->gpu_world;
    const frame_constants *c = &r->constants;
    uint64_t hash = settings_hash(HASH_START, &r->settings);
    hash = hash_add(hash, c->eye, sizeof c->eye);
    hash = hash_add(hash, &c->near_plane, sizeof c->near_plane);
    hash = hash_add(hash, c->forward, sizeof c->forward);
    hash = hash_add(hash, c->right, sizeof c->right);
    hash = hash_add(hash, c->up, sizeof c->up);
    hash = hash_add(hash, gpu_buffer_map(r->gpu, w->lights), c->light_count * sizeof(punctual_light));
    for (uint32_t i = 0; i < w->instance_count; i++) {
        hash = hash_add(hash, w->instance_data[i].world, sizeof w->instance_data[i].world);
        hash = hash_add(hash, &w->instance_data[i].mesh, sizeof w->instance_data[i].mesh);
    }
    for (uint32_t i = 0; i < r->scene->material_count; i++) {
        hash = hash_add(hash, w->material_data[i].base_color, sizeof w->material_data[i].base_color);
        hash = hash_add(hash, w->material_data[i].emissive, sizeof w->material_data[i].emissive);
    }
    for (uint32_t i = 0; i < r->scene->deformation_count; i++)
        hash = pose_hash(hash, r, i);
    return hash;
}

static void restart(progressive *state)
{
    state->done = 0;
    state->rays = 0;
    state->rays_pending = state->loaded = state->halves = false;
    state->error = NAN;
}

bool progressive_is_fresh(renderer *r)
{
    const progressive *state = state_of(r);
    return state->done == 0 || (!state->loaded && (state->key != key_of(r) || !progressive_is(r)));
}

void progressive_restart(renderer *r)
{
    restart(state_of(r));
}

// ---- Status

static const char *const ray_counters[] = {"rays_path|-", "rays_vpl|-", "rays_direct|-", "rays_shadow|-"};

// The graph forgets a frame's buffers when the next one begins, so this runs before that, and whenever somebody asks.
static void rays_collect(renderer *r, progressive *state)
{
    if (!state->rays_pending)
        return;
    state->rays_pending = false;
    for (size_t i = 0; i < countof(ray_counters); i++) {
        const gpu_buffer buffer = frame_graph_find_buffer(r->graph, ray_counters[i]);
        if (buffer.id)
            state->rays += *(const uint32_t *)gpu_buffer_map(r->gpu, buffer);
    }
}

static void rays_collect_system(ecs_world *world, void *user)
{
    (void)world;
    rays_collect(user, state_of(user));
}

// Adds up what the workgroups left; the last result where there is nothing new.
static double error_measure(renderer *r, const progressive *state)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, "progressive_error|-");
    if (!buffer.id || !state->halves || state->done < 2)
        return state->error;
    const float(*groups)[2] = gpu_buffer_map(r->gpu, buffer);
    const uint32_t count = div_up_u32(state->width, 8) * div_up_u32(state->height, 8);
    double variance = 0, square = 0;
    for (uint32_t i = 0; i < count; i++) {
        variance += (double)groups[i][0];
        square += (double)groups[i][1];
    }
    return square > 0 ? sqrt(variance / square) : 0;
}

progressive_status progressive_status_get(renderer *r, bool measure)
{
    progressive *state = state_of(r);
    const float until = r->settings.until;
    rays_collect(r, state);
    if (measure || until > 0)
        state->error = error_measure(r, state);
    const bool is_good = until > 0 && state->done >= UNTIL_SAMPLES_MIN && state->error <= (double)until;
    return (progressive_status){
        .done = state->done,
        .total = state->total,
        .error = state->error,
        .finished = is_good || (state->total > 0 && state->done >= state->total),
        .rays = state->rays,
    };
}

// ---- The state in a file: header, identity, sums, and the hash of all before it.

typedef struct state_header {
    char magic[8];
    uint32_t version, width, height, identity_size;
    uint64_t done;
    uint64_t frame; // the renderer's, which keys the random numbers of direct light
    double rays;
    double error; // NAN: not known
} state_header;

static const char state_magic[8] = {'L', 'F', 'S', 'T', 'A', 'T', 'E', '\n'};
enum { STATE_VERSION = 1 };

static size_t sums_size(uint32_t width, uint32_t height)
{
    return 2 * 4 * sizeof(float) * width * height;
}

bool progressive_save(renderer *r, const char *path, const char *identity)
{
    progressive *state = state_of(r);
    if (state->done == 0) {
        log_error("cannot write \"%s\": there is no progressive picture yet", path);
        return false;
    }
    rays_collect(r, state);
    state->error = error_measure(r, state);
    state_header header = {
        .version = STATE_VERSION,
        .width = state->width,
        .height = state->height,
        .identity_size = (uint32_t)strlen(identity),
        .done = state->done,
        .frame = r->frame,
        .rays = state->rays,
        .error = state->error,
    };
    memcpy(header.magic, state_magic, sizeof header.magic);
    const size_t sums_at = sizeof header + header.identity_size,
                 hash_at = sums_at + sums_size(state->width, state->height);
    uint8_t *bytes = memory_alloc(hash_at + sizeof(uint64_t));
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, identity, header.identity_size);
    bool ok = gpu_buffer_read(r->gpu, state->sums, 0, bytes + sums_at, sums_size(state->width, state->height));
    const uint64_t hash = hash_add(HASH_START, bytes, hash_at);
    memcpy(bytes + hash_at, &hash, sizeof hash);
    ok = ok && file_write(path, bytes, hash_at + sizeof hash);
    free(bytes);
    return ok;
}

// What is wrong with the file as such, or NULL.
static const char *state_damage(const uint8_t *bytes, size_t size, state_header *header)
{
    if (size < sizeof *header || memcmp(bytes, state_magic, sizeof state_magic) != 0)
        return "expected the state of a progressive picture, and it is none";
    memcpy(header, bytes, sizeof *header);
    if (header->version != STATE_VERSION)
        return "it was written by another version of this program";
    const uint64_t expected =
        sizeof *header + (uint64_t)header->identity_size + sums_size(header->width, header->height) + sizeof(uint64_t);
    if (size != expected)
        return size < expected ? "it is cut short" : "it is longer than it says";
    uint64_t hash;
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    return hash == hash_add(HASH_START, bytes, size - sizeof hash) ? NULL : "it is damaged: its checksum is wrong";
}

static size_t line_length(const char *text)
{
    return strcspn(text, "\n");
}

// Logs the first line in which the texts differ, cut to what can be read.
static void identity_difference_log(const char *path, const char *stored, const char *expected)
{
    while (*stored && *expected && line_length(stored) == line_length(expected) &&
           memcmp(stored, expected, line_length(stored)) == 0) {
        stored += line_length(stored) + (stored[line_length(stored)] != 0);
        expected += line_length(expected) + (expected[line_length(expected)] != 0);
    }
    log_error("%s: it was made for another picture: expected \"%.*s\", got \"%.*s\"", path,
              (int)(line_length(expected) < 80 ? line_length(expected) : 80), expected,
              (int)(line_length(stored) < 80 ? line_length(stored) : 80), stored);
}

static bool state_fits(const renderer *r, const char *path, const uint8_t *bytes, const state_header *header,
                       const char *identity)
{
    if (header->width != r->settings.width || header->height != r->settings.height) {
        log_error("%s: expected a picture of %ux%u, got one of %ux%u", path, r->settings.width, r->settings.height,
                  header->width, header->height);
        return false;
    }
    const bool same = header->identity_size == strlen(identity) &&
                      memcmp(bytes + sizeof *header, identity, header->identity_size) == 0;
    if (!same) {
        char *stored = memory_alloc((size_t)header->identity_size + 1);
        memcpy(stored, bytes + sizeof *header, header->identity_size);
        identity_difference_log(path, stored, identity);
        free(stored);
    }
    return same;
}

// Makes `sums` hold the size of the settings; a change of size begins anew. False: no memory, or too large (logged).
static bool sums_reserve(renderer *r, progressive *state)
{
    const uint32_t width = r->settings.width, height = r->settings.height;
    if (state->sums.id && state->width == width && state->height == height)
        return true;
    restart(state);
    gpu_buffer_destroy(r->gpu, state->sums);
    const gpu_buffer_desc desc = {
        .name = "sums of a progressive picture",
        .size = sums_size(width, height),
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
    };
    state->sums = gpu_buffer_create(r->gpu, &desc);
    state->width = width;
    state->height = height;
    return state->sums.id != 0;
}

bool progressive_load(renderer *r, const char *path, const char *identity)
{
    progressive *state = state_of(r);
    size_t size;
    uint8_t *bytes = file_read(path, &size);
    if (!bytes)
        return false;
    state_header header;
    const char *damage = state_damage(bytes, size, &header);
    if (damage)
        log_error("%s: %s", path, damage);
    bool ok = !damage && state_fits(r, path, bytes, &header, identity) && sums_reserve(r, state);
    ok = ok && gpu_buffer_write(r->gpu, state->sums, 0, bytes + sizeof header + header.identity_size,
                                sums_size(state->width, state->height));
    if (ok) {
        restart(state);
        state->loaded = true;
        state->done = header.done;
        r->frame = (uint32_t)header.frame;
        state->rays = header.rays;
        state->error = header.error;
    }
    free(bytes);
    return ok;
}

// ---- Passes

static void clear_execute(const frame_graph_context *context, void *user)
{
    const progressive *state = user;
    gpu_buffer_fill(context->commands, state->sums, 0, sums_size(state->width, state->height), 0);
}

uint64_t progressive_begin(renderer *r, uint64_t total)
{
    progressive *state = state_of(r);
    if (progressive_is_fresh(r))
        restart(state);
    state->loaded = false;
    state->key = key_of(r);
    state->total = total;
    if (!sums_reserve(r, state)) {
        r->failed = true;
        return 0;
    }
    const bool fresh = state->done == 0;
    frame_graph_import_buffer(r->graph, fresh ? "sums_old" : "sums_before", state->sums, ACCESS_STORAGE_READ_WRITE,
                              ACCESS_NONE);
    if (fresh) {
        const frame_graph_pass_desc desc = {
            .name = "progressive/clear", .kind = FRAME_GRAPH_TRANSFER, .execute = clear_execute, .user = state};
        frame_graph_modify(frame_graph_pass_add(r->graph, &desc), "sums_old", "sums_before", ACCESS_TRANSFER_WRITE);
    }
    return state->done;
}

typedef struct picture_pass {
    progressive *state;
    uint64_t count;
    uint32_t width, height;
    struct {
        float factors[2];
        float half_factors[2]; // from the halves' sums to their means
        float variance_factor; // from the squared difference of the means to the variance of their weighted mean
        uint32_t emission;
    } push;
} picture_pass;

static void picture_execute(const frame_graph_context *context, void *user)
{
    const picture_pass *pass = user;
    frame_graph_bind(context, pass->state->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 8), div_up_u32(pass->height, 8), 1);
    pass->state->done += pass->count; // only now is it certain that the frame is made
    pass->state->rays_pending = true;
}

// With N = A + B samples in the two halves, the difference of the halves' means has the variance s^2 (1/A + 1/B) and
// the mean of all has s^2 / N, which is AB / N^2 of it.
static void halves_write(picture_pass *pass, uint64_t samples)
{
    const double odd = (double)(samples / 2), even = (double)samples - odd;
    pass->push.half_factors[0] = (float)(1 / even);
    pass->push.half_factors[1] = (float)(1 / odd);
    pass->push.variance_factor = (float)(even * odd / ((even + odd) * (even + odd)));
}

void progressive_end(renderer *r, uint64_t count, const float factors[2], bool halves)
{
    progressive *state = state_of(r);
    const render_settings *s = &r->settings;
    picture_pass args = {
        .state = state,
        .count = count,
        .width = s->width,
        .height = s->height,
        .push = {.factors = {factors[0], factors[1]},
                 .emission = s->only != ONLY_INDIRECT && s->only != ONLY_INDIRECT_UNSHADOWED},
    };
    if (halves && state->done + count >= 2)
        halves_write(&args, state->done + count);
    state->halves = halves;
    const frame_graph_pass_desc desc = {
        .name = "progressive",
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = picture_execute,
        .user = &args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    const frame_graph_resource_desc image = frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, s->width, s->height);
    const frame_graph_resource_desc error = {
        .kind = FRAME_GRAPH_BUFFER,
        .size = 2 * sizeof(float) * (uint64_t)div_up_u32(s->width, 8) * div_up_u32(s->height, 8),
        .host = true,
    };
    frame_graph_read(pass, "sums|sums_before", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "albedo", ACCESS_SAMPLED);
    frame_graph_read(pass, "emission", ACCESS_SAMPLED);
    frame_graph_create_resource(pass, "radiance", &image, ACCESS_STORAGE_WRITE);
    frame_graph_create_resource(pass, "progressive_error", &error, ACCESS_STORAGE_WRITE);
    frame_graph_export(r->graph, "progressive_error", ACCESS_TRANSFER_READ);
    // Keeping a counter keeps the pass that counts, and path tracing needs no others than its own.
    for (size_t i = 0; i < (s->method == METHOD_PATH ? 1 : countof(ray_counters)); i++)
        frame_graph_export(r->graph, ray_counters[i], ACCESS_TRANSFER_READ);
}

// ---- Life

// Only the methods add passes. One that needs no sums gives their memory back.
static void progressive_setup(renderer *r, void *user)
{
    progressive *state = user;
    if (r->settings.method != METHOD_LGH || !state->sums.id)
        return;
    restart(state);
    gpu_buffer_destroy(r->gpu, state->sums);
    state->sums = (gpu_buffer){0};
}

static void progressive_fini(renderer *r, void *user)
{
    const progressive *state = user;
    gpu_pipeline_destroy(r->gpu, state->pipeline);
    gpu_buffer_destroy(r->gpu, state->sums);
}

bool progressive_init(renderer *r)
{
    progressive *state = renderer_pass_add(r, "progressive", sizeof(progressive), progressive_setup, progressive_fini);
    restart(state);
    const gpu_compute_pipeline_desc desc = {.shader = &shader_progressive_comp};
    state->pipeline = gpu_compute_pipeline_create(r->gpu, &desc);
    const ecs_system_desc collect = {
        .name = "progressive", .phase = ECS_PHASE_EXTRACT, .run = rays_collect_system, .user = r};
    ecs_system_register(r->world, &collect);
    return state->pipeline.id != 0;
}
