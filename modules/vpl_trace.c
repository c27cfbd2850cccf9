// Virtual point lights at the hits of light paths: makes `vpls`, and counts the rays in `rays_vpl`. The paths' first
// rays are one batch, and each bounce makes of a batch's hits the next.
//
// Behind them, where a scene has many, its point lights as they are: see renderer_light_slots.
//
// VPLs stay from frame to frame. A path is traced again when its source changed, or when one of its segments meets the
// box of a surface that came, went, moved, deformed or changed its colour; so the slots of all others are what tracing
// them again would make, to the bit. (But where two instances' surfaces coincide: there it is the order of traversal
// that chooses.)
#include "deform.h"
#include "modules.h"
#include "rays.h"
#include "resource_chain.h"
#include "vpl_deal.h"
#include "vpl_reference.h"
#include "vpl_trace.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BOXES_MAX = 64 }; // the last is around all that do not fit

typedef enum pipeline_name {
    EMIT,
    BOUNCE,
    LIGHTS,
    MARK,
    LIST,
    EMIT_SOME,
    BOUNCE_SOME,
    LIGHTS_SOME,
    PIPELINES
} pipeline_name;

typedef struct trace_key { // what VPLs depend on beside the world
    uint32_t slots, light_slots, bounces, seed, rays;
    bool is_host;
} trace_key;

typedef struct vpl_trace {
    gpu_pipeline pipelines[PIPELINES];
    vpl_deal deal;
    // Host: shares[paths], sources[groups], elements[], boxes[BOXES_MAX]; see shaders/shared.h.
    gpu_buffer shares, sources, elements, boxes;
    gpu_buffer slot_lights; // host: uint[light_slots]
    gpu_buffer vpls; // vpl[slots + light_slots], the latest
    gpu_buffer starts; // vec3[paths]: where they left their sources
    trace_key key; // of `vpls`
    uint32_t kept_for; // frame at whose beginning `vpls` are those of the frame before; 0: none
    uint32_t dealt_for; // the same of the deal
    vpl_change change; // of this frame
    uint32_t box_count; // of this frame
} vpl_trace;

typedef struct vpl_pass {
    vpl_trace *state;
    pipeline_name pipeline;
    uint32_t groups; // workgroups; 0: as many as `vpl_list` says
    uint32_t next_frame; // of the last pass: the VPLs are kept for it; else 0
    uint32_t push[5];
} vpl_pass;

// What is handed on from bounce to bounce.
typedef struct vpl_chains {
    uint32_t paths, rays; // rays of a batch: a path each, and one for the slots that no path fills
    resource_chain counter, flux, vpls, changed;
} vpl_chains;

typedef struct batch_name {
    char text[32];
} batch_name;

static batch_name batch_of(uint32_t bounce)
{
    batch_name name;
    snprintf(name.text, sizeof name.text, "vpl_trace/%u", bounce + 1);
    return name;
}

// ---- Passes

static void execute(const frame_graph_context *context, void *user)
{
    const vpl_pass *pass = user;
    frame_graph_bind(context, pass->state->pipelines[pass->pipeline]);
    gpu_push(context->commands, pass->push, sizeof pass->push);
    if (pass->groups > 0)
        gpu_dispatch(context->commands, pass->groups, 1, 1);
    else
        gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, "vpl_list"), 0);
    if (pass->next_frame > 0)
        pass->state->kept_for = pass->next_frame;
}

static frame_graph_pass *pass_add(renderer *r, const char *name, vpl_pass args)
{
    const frame_graph_pass_desc desc = {
        .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &args, .user_size = sizeof args};
    return frame_graph_pass_add(r->graph, &desc);
}

static void read_all(frame_graph_pass *pass, const char *const *names, size_t count)
{
    for (size_t i = 0; i < count; i++)
        frame_graph_read(pass, names[i], ACCESS_STORAGE_READ);
}

static uint32_t slots_of(const vpl_trace *state)
{
    return state->key.slots + state->key.light_slots;
}

// Lists the paths that have to be traced again.
static void list_declare(renderer *r, vpl_trace *state, vpl_chains *chains)
{
    static const char *const inputs[] = {"vpl_shares", "vpl_sources", "vpl_boxes", "vpl_starts_kept", "vpls_1"};
    const uint32_t groups = div_up_u32(chains->paths, 64);
    frame_graph_pass *mark = pass_add(
        r, "vpl_trace/mark",
        (vpl_pass){.state = state,
                   .pipeline = MARK,
                   .groups = groups,
                   .push = {state->key.slots, state->key.bounces, chains->paths, state->box_count, slots_of(state)}});
    read_all(mark, inputs, countof(inputs));
    const frame_graph_resource_desc mask = frame_graph_buffer_of(groups * 2ull * sizeof(uint32_t));
    frame_graph_create_resource(mark, "vpl_mask", &mask, ACCESS_STORAGE_WRITE);
    resource_chain_next(&chains->changed, mark);

    frame_graph_pass *list =
        pass_add(r, "vpl_trace/list",
                 (vpl_pass){.state = state, .pipeline = LIST, .groups = 1, .push = {div_up_u32(chains->paths, 32)}});
    const frame_graph_resource_desc listed = frame_graph_buffer_of((4 + chains->paths) * sizeof(uint32_t));
    frame_graph_create_resource(list, "vpl_list", &listed, ACCESS_STORAGE_WRITE);
    frame_graph_read(list, "vpl_mask", ACCESS_STORAGE_READ);
}

static void emit_declare(renderer *r, vpl_trace *state, vpl_chains *chains)
{
    static const char *const inputs[] = {"vpl_shares", "vpl_sources", "vpl_elements"};
    const bool some = state->change == VPLS_SOME;
    frame_graph_pass *pass = pass_add(r, "vpl_trace/emit",
                                      (vpl_pass){.state = state,
                                                 .pipeline = some ? EMIT_SOME : EMIT,
                                                 .groups = div_up_u32(chains->rays, 64),
                                                 .push = {chains->paths, chains->rays}});
    resource_chain_next(&chains->counter, pass);
    rays_create(r, pass, batch_of(0).text, chains->rays);
    resource_chain_next(&chains->flux, pass);
    read_all(pass, inputs, countof(inputs));
    frame_graph_modify(pass, "vpl_starts_kept", "vpl_starts", ACCESS_STORAGE_READ_WRITE);
    if (some)
        frame_graph_read(pass, "vpl_list", ACCESS_STORAGE_READ);
}

static void bounce_declare(renderer *r, vpl_trace *state, vpl_chains *chains, uint32_t bounce, bool last)
{
    const uint32_t next_frame = last && state->key.light_slots == 0 ? r->frame + 1 : 0;
    const bool some = state->change == VPLS_SOME;
    char name[48], hits[48];
    snprintf(name, sizeof name, "%s/bounce", batch_of(bounce).text);
    snprintf(hits, sizeof hits, "%s_hits", batch_of(bounce).text);
    const vpl_pass args = {.state = state,
                           .pipeline = some ? BOUNCE_SOME : BOUNCE,
                           .groups = some ? 0 : div_up_u32(chains->rays, 64),
                           .next_frame = next_frame,
                           .push = {state->key.slots, state->key.bounces, bounce, last}};
    frame_graph_pass *pass = pass_add(r, name, args);
    resource_chain_next(&chains->counter, pass);
    rays_modify(r, pass, batch_of(bounce).text, batch_of(bounce + 1).text);
    resource_chain_next(&chains->flux, pass);
    resource_chain_next(&chains->vpls, pass);
    frame_graph_read(pass, hits, ACCESS_STORAGE_READ);
    read_all(pass, (const char *const[]){"vpl_shares", "vpl_sources"}, 2);
    if (some) {
        frame_graph_read(pass, "vpl_list", ACCESS_STORAGE_READ);
        resource_chain_next(&chains->changed, pass);
        frame_graph_read(pass, "vpl_list", ACCESS_INDIRECT);
    }
    deform_read(pass);
}

// The point lights that join the hierarchy, in the slots behind.
static void lights_declare(renderer *r, vpl_trace *state, vpl_chains *chains)
{
    const bool some = state->change == VPLS_SOME;
    frame_graph_pass *pass = pass_add(r, "vpl_trace/lights",
                                      (vpl_pass){.state = state,
                                                 .pipeline = some ? LIGHTS_SOME : LIGHTS,
                                                 .groups = div_up_u32(state->key.light_slots, 64),
                                                 .next_frame = r->frame + 1,
                                                 .push = {state->key.slots, state->key.light_slots}});
    resource_chain_next(&chains->vpls, pass);
    frame_graph_import_buffer(r->graph, "vpl_slot_lights", state->slot_lights, ACCESS_HOST_WRITE, ACCESS_NONE);
    frame_graph_read(pass, "vpl_slot_lights", ACCESS_STORAGE_READ);
    if (some)
        resource_chain_next(&chains->changed, pass);
}

static void buffers_import(renderer *r, const vpl_trace *state)
{
    const struct {
        const char *name;
        gpu_buffer buffer;
        frame_graph_access before;
    } imports[] = {
        {"vpl_shares", state->shares, ACCESS_HOST_WRITE},
        {"vpl_sources", state->sources, ACCESS_HOST_WRITE},
        {"vpl_elements", state->elements, ACCESS_HOST_WRITE},
        {"vpl_boxes", state->boxes, ACCESS_HOST_WRITE},
        {"vpls_1", state->vpls, ACCESS_STORAGE_READ_WRITE},
        {"vpl_starts_kept", state->starts, ACCESS_STORAGE_READ_WRITE},
    };
    for (size_t i = 0; i < countof(imports); i++)
        frame_graph_import_buffer(r->graph, imports[i].name, imports[i].buffer, imports[i].before, ACCESS_NONE);
}

static void trace_declare(renderer *r, vpl_trace *state)
{
    const uint32_t slots = state->key.slots, bounces = min_u32(state->key.bounces, slots);
    const uint32_t rays = div_up_u32(slots, state->key.bounces);
    const uint32_t makers = 1 + bounces + (state->key.light_slots > 0);
    vpl_chains chains = {
        .paths = state->deal.path_count,
        .rays = rays,
        .counter = resource_chain_counter(r->graph, "vpl_trace/clear", "rays_vpl", 1 + bounces),
        .flux = {"vpl_flux", frame_graph_buffer_of(rays * 3ull * sizeof(float)), 1 + bounces, 0},
        .vpls = {.name = "vpls", .length = makers, .done = 1}, // the first is the import
        .changed = {"vpl_changed", frame_graph_buffer_of(div_up_u32(slots_of(state), 32) * sizeof(uint32_t)), makers,
                    0},
    };
    buffers_import(r, state);
    if (state->change == VPLS_SOME)
        list_declare(r, state, &chains);
    emit_declare(r, state, &chains);
    for (uint32_t bounce = 0; bounce < bounces; bounce++) {
        rays_trace(r, batch_of(bounce).text, RAYS_NEAREST, rays);
        bounce_declare(r, state, &chains, bounce, bounce + 1 == bounces);
    }
    if (state->key.light_slots > 0)
        lights_declare(r, state, &chains);
}

// ---- What the passes read

// Deals the paths by power. Sources come by kind and entity, so that their keys ascend.
static void paths_deal(const renderer *r, vpl_trace *state, uint32_t paths)
{
    const world_gpu *w = r->gpu_world;
    vpl_deal_source *sources = memory_alloc(max_u32(w->source_count, 1) * sizeof *sources);
    for (uint32_t i = 0; i < w->source_count; i++) {
        const world_source *s = &w->sources[i];
        sources[i] =
            (vpl_deal_source){(uint64_t)s->emissive << 32 | renderer_entity_key(r, s->entity), s->power, s->changed};
    }
    vpl_deal_update(&state->deal, paths, sources, w->source_count);
    free(sources);
}

// Appends those of one source; returns the new sum of their powers.
static double elements_append(const renderer *r, const world_source *source, double sum, double total,
                              vpl_element *elements, uint32_t *count)
{
    for (uint32_t i = 0; i < source->count; i++) {
        const uint32_t light = source->first + i;
        sum += (double)world_element_power(r, light);
        elements[(*count)++] = (vpl_element){light, (float)(sum / total)};
    }
    return sum;
}

static double elements_power(const renderer *r, const world_source *source)
{
    double sum = 0;
    for (uint32_t i = 0; i < source->count; i++)
        sum += (double)world_element_power(r, source->first + i);
    return sum;
}

static void weak_elements_write(const renderer *r, const vpl_deal *deal, vpl_element *elements, uint32_t *count)
{
    const world_gpu *w = r->gpu_world;
    double total = 0, sum = 0;
    for (uint32_t i = 0; i < w->source_count; i++)
        for (uint32_t k = 0; k < w->sources[i].count && deal->group_of[i] == VPL_DEAL_WEAK; k++)
            total += (double)world_element_power(r, w->sources[i].first + k);
    for (uint32_t i = 0; i < w->source_count; i++)
        if (deal->group_of[i] == VPL_DEAL_WEAK && total > 0)
            sum = elements_append(r, &w->sources[i], sum, total, elements, count);
}

static vpl_source source_make(const renderer *r, const vpl_deal *deal, uint32_t group, vpl_element *elements,
                              uint32_t *count)
{
    const vpl_deal_group *from = &deal->groups[group];
    vpl_source made = {.first = *count, .paths = from->paths, .key = group, .changed = from->changed};
    if (group == VPL_DEAL_WEAK)
        weak_elements_write(r, deal, elements, count);
    if (group >= VPL_DEAL_FIRST) {
        const world_source *source = &r->gpu_world->sources[from->source];
        elements_append(r, source, 0, elements_power(r, source), elements, count);
        made.key = (uint32_t)from->key ^ (uint32_t)(from->key >> 32) << 31;
    }
    made.count = *count - made.first;
    return made;
}

// After the paths were dealt or lights were numbered anew. False: no memory.
static bool deal_write(renderer *r, vpl_trace *state)
{
    const vpl_deal *deal = &state->deal;
    const uint32_t lights = r->constants.light_count + r->constants.emitter_count;
    vpl_share *shares =
        world_buffer_reserve(r, &state->shares, "vpl shares", BINDING_NONE, deal->path_count * sizeof *shares);
    vpl_source *sources =
        world_buffer_reserve(r, &state->sources, "vpl sources", BINDING_NONE, deal->group_count * sizeof *sources);
    vpl_element *elements =
        world_buffer_reserve(r, &state->elements, "vpl elements", BINDING_NONE, lights * sizeof *elements);
    if (!shares || !sources || !elements)
        return false;
    memcpy(shares, deal->shares, deal->path_count * sizeof *shares);
    uint32_t count = 0;
    for (uint32_t g = 0; g < deal->group_count; g++)
        sources[g] = source_make(r, deal, g, elements, &count);
    return true;
}

// No source of this frame changed.
static void deal_rest(renderer *r, vpl_trace *state)
{
    vpl_source *sources = gpu_buffer_map(r->gpu, state->sources);
    for (uint32_t g = 0; g < state->deal.group_count; g++) {
        state->deal.groups[g].changed = false;
        sources[g].changed = 0;
    }
}

static bool deal_follow(renderer *r, vpl_trace *state, uint32_t paths)
{
    const bool stands = state->dealt_for == r->frame && r->frame > 0 && state->deal.path_count == paths;
    state->dealt_for = r->frame + 1;
    if (stands && !r->gpu_world->changes.sources) {
        deal_rest(r, state);
        return true;
    }
    paths_deal(r, state, paths);
    return deal_write(r, state);
}

// Wider than the box by more than an origin's offset from its surface, and than rounding.
static vpl_box box_padded(const renderer *r, const box *from)
{
    vpl_box made;
    for (int k = 0; k < 3; k++) {
        const float largest = fmaxf(fabsf(from->min[k]), fabsf(from->max[k]));
        const float pad = 1e-4f * r->constants.scene_radius + 1e-5f * largest;
        made.low[k] = from->min[k] - pad;
        made.high[k] = from->max[k] + pad;
    }
    return made;
}

static bool boxes_write(renderer *r, vpl_trace *state)
{
    const world_changes *changes = &r->gpu_world->changes;
    vpl_box *boxes = world_buffer_reserve(r, &state->boxes, "vpl boxes", BINDING_NONE, BOXES_MAX * sizeof *boxes);
    if (!boxes)
        return false;
    state->box_count = min_u32(changes->box_count, BOXES_MAX);
    for (uint32_t i = 0; i < changes->box_count; i++) {
        const vpl_box made = box_padded(r, &changes->boxes[i]);
        vpl_box *to = &boxes[min_u32(i, BOXES_MAX - 1)];
        if (i < BOXES_MAX)
            *to = made;
        for (int k = 0; k < 3; k++) {
            to->low[k] = fminf(to->low[k], made.low[k]);
            to->high[k] = fmaxf(to->high[k], made.high[k]);
        }
    }
    return true;
}

static bool slot_lights_write(renderer *r, vpl_trace *state)
{
    const light_slots *slots = &r->gpu_world->light_slots;
    const size_t size = renderer_light_slots(r) * sizeof *slots->lights;
    uint32_t *lights =
        world_buffer_reserve(r, &state->slot_lights, "slot lights", BINDING_NONE, size > 0 ? size : sizeof *lights);
    if (lights && size > 0)
        memcpy(lights, slots->lights, size);
    return lights != NULL;
}

// Room for VPLs; others than before are undefined.
static bool vpls_reserve(renderer *r, vpl_trace *state, uint32_t slots, uint32_t paths)
{
    const struct {
        gpu_buffer *buffer;
        gpu_buffer_desc desc;
    } buffers[] = {
        {&state->vpls, {.name = "vpls", .size = (uint64_t)slots * sizeof(vpl)}},
        {&state->starts, {.name = "vpl starts", .size = paths * 3ull * sizeof(float)}},
    };
    for (size_t i = 0; i < countof(buffers); i++) {
        gpu_buffer_desc desc = buffers[i].desc;
        if (buffers[i].buffer->id && gpu_buffer_size(r->gpu, *buffers[i].buffer) == desc.size)
            continue;
        gpu_buffer_destroy(r->gpu, *buffers[i].buffer);
        desc.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
        *buffers[i].buffer = gpu_buffer_create(r->gpu, &desc);
        if (!buffers[i].buffer->id)
            return false;
    }
    return true;
}

// ---- What changed

static bool keys_equal(const trace_key *a, const trace_key *b)
{
    return a->slots == b->slots && a->light_slots == b->light_slots && a->bounces == b->bounces && a->seed == b->seed &&
           a->rays == b->rays && a->is_host == b->is_host;
}

// The offsets of rays and the rectangles that suns shine through follow the bounds. Where most paths changed, listing
// them is not worth its time.
static vpl_change change_find(const renderer *r, const vpl_trace *state, const trace_key *key)
{
    const world_changes *changes = &r->gpu_world->changes;
    if (!r->settings.incremental || r->frame == 0 || state->kept_for != r->frame || !keys_equal(key, &state->key) ||
        changes->bounds)
        return VPLS_ALL;
    uint64_t changed = 0;
    bool any = changes->box_count > 0;
    for (uint32_t g = 0; g < state->deal.group_count; g++) {
        changed += state->deal.groups[g].changed ? state->deal.groups[g].paths : 0;
        any |= state->deal.groups[g].changed;
    }
    return changed > state->deal.path_count / 2 ? VPLS_ALL : any ? VPLS_SOME : VPLS_NONE;
}

static vpl_trace *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "vpl_trace"), r->pass))->state;
}

vpl_change vpl_trace_change(const renderer *r)
{
    return state_of(r)->change;
}

static void vpl_trace_setup(renderer *r, void *user)
{
    vpl_trace *state = user;
    state->change = VPLS_ALL;
    if (!renderer_has_vpls(r) || vpl_reference_has_vpls(r))
        return;
    const trace_key key = {renderer_vpl_slots(r), renderer_light_slots(r), r->settings.bounces,
                           r->settings.seed,      r->settings.rays,        rays_are_host(r)};
    const uint32_t paths = max_u32(1, key.slots / key.bounces);
    if (!deal_follow(r, state, paths) || !boxes_write(r, state) || !slot_lights_write(r, state) ||
        !vpls_reserve(r, state, key.slots + key.light_slots, paths)) {
        r->failed = true;
        return;
    }
    state->change = change_find(r, state, &key);
    state->key = key;
    if (state->change != VPLS_NONE) {
        trace_declare(r, state);
        return;
    }
    frame_graph_import_buffer(r->graph, "vpls", state->vpls, ACCESS_STORAGE_READ_WRITE, ACCESS_NONE);
    state->kept_for = r->frame + 1;
}

// ---- Life

static void vpl_trace_fini(renderer *r, void *user)
{
    vpl_trace *state = user;
    for (uint32_t i = 0; i < PIPELINES; i++)
        gpu_pipeline_destroy(r->gpu, state->pipelines[i]);
    const gpu_buffer buffers[] = {state->shares,      state->sources, state->elements, state->boxes,
                                  state->slot_lights, state->vpls,    state->starts};
    for (size_t i = 0; i < countof(buffers); i++)
        gpu_buffer_destroy(r->gpu, buffers[i]);
    vpl_deal_fini(&state->deal);
}

bool vpl_trace_init(renderer *r)
{
    static const gpu_shader *const shaders[PIPELINES] = {
        [EMIT] = &shader_vpl_trace_emit_comp,
        [BOUNCE] = &shader_vpl_trace_bounce_comp,
        [LIGHTS] = &shader_vpl_trace_lights_comp,
        [MARK] = &shader_vpl_trace_mark_comp,
        [LIST] = &shader_vpl_trace_list_comp,
        [EMIT_SOME] = &shader_vpl_trace_emit_some_comp,
        [BOUNCE_SOME] = &shader_vpl_trace_bounce_some_comp,
        [LIGHTS_SOME] = &shader_vpl_trace_lights_some_comp,
    };
    vpl_trace *state = renderer_pass_add(r, "vpl_trace", sizeof(vpl_trace), vpl_trace_setup, vpl_trace_fini);
    for (uint32_t i = 0; i < PIPELINES; i++) {
        state->pipelines[i] = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shaders[i]});
        if (!state->pipelines[i].id)
            return false;
    }
    return true;
}
