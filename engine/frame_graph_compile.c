// The pure half of the frame graph: see frame_graph_compile.h. Everything works on passes and imports sorted by name,
// so that the order of registration cannot show in the plan.
#include "frame_graph_compile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = FRAME_GRAPH_NONE };

// ---- The table of accesses

enum {
    BUFFERS = 1 << FRAME_GRAPH_BUFFER,
    IMAGES = 1 << FRAME_GRAPH_IMAGE,
    ACCELERATIONS = 1 << FRAME_GRAPH_ACCELERATION,
    GRAPHICS = 1 << FRAME_GRAPH_GRAPHICS,
    SHADERS = GRAPHICS | 1 << FRAME_GRAPH_COMPUTE | 1 << FRAME_GRAPH_RAY_TRACING,
    DEVICE = SHADERS | 1 << FRAME_GRAPH_TRANSFER,
    HOST = 1 << FRAME_GRAPH_HOST,
};

#define GRAPHICS_SHADERS (VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT | VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT)
#define DEPTH_STAGES (VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT)

// There are no ray tracing pipelines: rays are traced by ray queries in compute shaders.
static const VkPipelineStageFlags2 SHADER_STAGES[] = {
    [FRAME_GRAPH_GRAPHICS] = GRAPHICS_SHADERS,
    [FRAME_GRAPH_COMPUTE] = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
    [FRAME_GRAPH_TRANSFER] = 0,
    [FRAME_GRAPH_RAY_TRACING] = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
    [FRAME_GRAPH_HOST] = 0,
};
// Before and after the frame nothing tells which shaders.
#define ANY_SHADER (GRAPHICS_SHADERS | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT)

static const VkAccessFlags2 WRITE_MASK = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT |
                                         VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT |
                                         VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_HOST_WRITE_BIT |
                                         VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;

static const frame_graph_access_info ACCESSES[ACCESS_COUNT] = {
    [ACCESS_NONE] = {.name = "none"},
    [ACCESS_COLOR_ATTACHMENT] =
        {
            .name = "color attachment",
            .stages = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
            .mask = VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT,
            .write = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_ATTACHMENT] =
        {
            .name = "depth attachment",
            .stages = DEPTH_STAGES,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT,
            .write = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_TEST] =
        {
            .name = "depth test",
            .stages = DEPTH_STAGES,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_TEST_SAMPLED] =
        {
            .name = "depth test, sampled",
            .stages = DEPTH_STAGES,
            .shader = true,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_SHADER_SAMPLED_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT,
            .binding = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_SAMPLED] =
        {
            .name = "sampled",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_SAMPLED_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_SAMPLED_BIT,
            .binding = true,
            .resource_kinds = IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_READ] =
        {
            .name = "storage read",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_WRITE] =
        {
            .name = "storage write",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .write = true,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_READ_WRITE] =
        {
            .name = "storage read and write",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT |
                    VK_ACCESS_2_TRANSFER_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .write = true,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_UNIFORM] =
        {
            .name = "uniform",
            .shader = true,
            .mask = VK_ACCESS_2_UNIFORM_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT,
            .binding = true,
            .resource_kinds = BUFFERS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_INDIRECT] =
        {
            .name = "indirect",
            .stages = VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
            .mask = VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_TRANSFER_READ] =
        {
            .name = "transfer read",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .mask = VK_ACCESS_2_TRANSFER_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
            .buffer_usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = DEVICE,
        },
    [ACCESS_TRANSFER_WRITE] =
        {
            .name = "transfer write",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .mask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT,
            .buffer_usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT,
            .write = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = DEVICE,
        },
    [ACCESS_BUILD_INPUT] =
        {
            .name = "build input",
            .stages = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            // The specification has builds read their instances, and all but scratch, as shader reads.
            .mask = VK_ACCESS_2_SHADER_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = DEVICE,
        },
    [ACCESS_BUILD_WRITE] =
        {
            .name = "build write",
            .stages = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            .mask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
            .write = true,
            .resource_kinds = ACCELERATIONS,
            .pass_kinds = DEVICE,
        },
    [ACCESS_TRACE] =
        {
            .name = "trace",
            .shader = true,
            .mask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR,
            .binding = true,
            .resource_kinds = ACCELERATIONS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_HOST_READ] =
        {
            .name = "host read",
            .stages = VK_PIPELINE_STAGE_2_HOST_BIT,
            .mask = VK_ACCESS_2_HOST_READ_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = HOST,
        },
    [ACCESS_HOST_WRITE] =
        {
            .name = "host write",
            .stages = VK_PIPELINE_STAGE_2_HOST_BIT,
            .mask = VK_ACCESS_2_HOST_WRITE_BIT,
            .write = true,
            .resource_kinds = BUFFERS,
            .pass_kinds = HOST,
        },
};

const frame_graph_access_info *frame_graph_access_describe(frame_graph_access access)
{
    assert((uint32_t)access < ACCESS_COUNT);
    return &ACCESSES[access];
}

static const char *const PASS_KINDS[] = {"graphics", "compute", "transfer", "ray tracing", "host"};
static const char *const RESOURCE_KINDS[] = {"buffer", "image", "acceleration structure"};
static const char *const USE_VERBS[] = {"creates", "reads", "modifies", "reads last frame's"};

static bool access_is_attachment(frame_graph_access access)
{
    return access == ACCESS_COLOR_ATTACHMENT || access == ACCESS_DEPTH_ATTACHMENT || access == ACCESS_DEPTH_TEST ||
           access == ACCESS_DEPTH_TEST_SAMPLED;
}

// ---- Lists of alternatives: "filtered|raw|-"

typedef struct span {
    const char *text;
    size_t length;
} span;

// Takes the next name off `*rest`, which becomes NULL after the last.
static bool span_next(const char **rest, span *name)
{
    if (!*rest) {
        return false;
    }
    const char *const end = strchrnul(*rest, '|');
    *name = (span){*rest, (size_t)(end - *rest)};
    *rest = *end ? end + 1 : NULL;
    return true;
}

static int span_compare(span a, const char *b)
{
    const int difference = strncmp(a.text, b, a.length);
    return difference ? difference : b[a.length] ? -1 : 0;
}

static bool span_is_dash(span name)
{
    return span_compare(name, "-") == 0;
}

static bool alternatives_are_optional(const char *alternatives)
{
    const char *const last = strrchr(alternatives, '|');
    return strcmp(last ? last + 1 : alternatives, "-") == 0;
}

// Names are not empty, and "-" comes last and not alone.
static bool alternatives_are_well_formed(const char *alternatives)
{
    bool first = true;
    span name;
    for (const char *rest = alternatives; span_next(&rest, &name); first = false) {
        if (name.length == 0 || (span_is_dash(name) && (rest || first))) {
            return false;
        }
    }
    return !first;
}

static bool name_is_well_formed(const char *name)
{
    return name && *name && !strchr(name, '|') && strcmp(name, "-") != 0;
}

bool frame_graph_names(const char *alternatives, const char *name)
{
    if (strcmp(alternatives, name) == 0) {
        return true;
    }
    span alternative;
    for (const char *rest = alternatives; span_next(&rest, &alternative);) {
        if (span_compare(alternative, name) == 0) {
            return true;
        }
    }
    return false;
}

// ---- The compiler's state

// A name: the contents that one maker leaves in a resource.
typedef struct version {
    const char *name;
    uint32_t import; // made by this import, else
    uint32_t pass, use; // by this use
    bool exists; // an optional modification makes nothing when what it modifies does not exist
    uint32_t source; // the version that a modification consumes
    uint32_t modifier; // the pass that consumes this version
    uint32_t root; // the first version of the chain: stands for the resource
    uint32_t resource; // roots: in the plan
    frame_graph_access after; // roots: the state to leave the resource in
    bool exported;
    bool previous_read; // by a pass that runs
    bool consumed; // by another pass that runs
} version;

// `before` runs before the pass that owns the edge.
typedef struct edge {
    uint32_t before;
    uint32_t version; // why
    bool overwrites; // because the owner modifies what `before` reads; else because it needs what `before` makes
} edge;

typedef struct node {
    const frame_graph_pass_decl *decl;
    uint32_t *consumes; // of each use: the version read or modified
    uint32_t *makes; // of each use: the version created or the outcome of the modification
    frame_graph_plan_use *uses;
    edge *edges;
    uint32_t edge_count;
    uint32_t depth;
    enum { UNSEEN, OPEN, DONE } visit;
    bool has_successor;
    bool live;
} node;

typedef struct compiler {
    const frame_graph_input *input;
    arena *arena;
    char *error;
    node *passes; // sorted
    version *versions; // sorted by name
    uint32_t version_count;
    uint32_t *order;
    uint32_t order_count;
    uint32_t *stack; // passes on the way from the sink, while ordering
    uint32_t stack_count;
    struct chain *chains; // parallel to the plan's resources
    frame_graph_plan *plan;
} compiler;

static void *many(compiler *c, uint32_t count, size_t size)
{
    return arena_alloc(c->arena, (count ? count : 1) * size);
}

// Writes the sentence; always false.
__attribute__((format(printf, 2, 3))) static bool fail(compiler *c, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(c->error, 512, format, arguments);
    va_end(arguments);
    return false;
}

static const frame_graph_resource_desc *version_desc(const compiler *c, uint32_t index)
{
    const version *const root = &c->versions[c->versions[index].root];
    return root->import != NONE ? &c->input->imports[root->import].desc
                                : &c->passes[root->pass].decl->uses[root->use].desc;
}

static bool version_is_imported(const compiler *c, uint32_t index)
{
    return c->versions[c->versions[index].root].import != NONE;
}

// ---- Sort: by name, and among equal names by what they declare. What then still compares equal is interchangeable.

static int text_compare(const char *a, const char *b)
{
    return strcmp(a ? a : "", b ? b : "");
}

static int use_compare(const frame_graph_use *a, const frame_graph_use *b)
{
    const int kind = (int)a->kind - (int)b->kind, access = (int)a->access - (int)b->access;
    const int name = text_compare(a->name, b->name);
    return kind ? kind : access ? access : name ? name : text_compare(a->makes, b->makes);
}

static int pass_compare(const void *left, const void *right)
{
    const frame_graph_pass_decl *const a = ((const node *)left)->decl, *const b = ((const node *)right)->decl;
    const int name = strcmp(a->name, b->name), kind = (int)a->kind - (int)b->kind;
    if (name || kind) {
        return name ? name : kind;
    }
    for (uint32_t i = 0; i < min_u32(a->use_count, b->use_count); i++) {
        const int use = use_compare(&a->uses[i], &b->uses[i]);
        if (use) {
            return use;
        }
    }
    return a->use_count != b->use_count ? (a->use_count < b->use_count ? -1 : 1) : a < b ? -1 : 1;
}

static void declarations_sort(compiler *c)
{
    const frame_graph_input *const input = c->input;
    c->passes = many(c, input->pass_count, sizeof(*c->passes));
    for (uint32_t i = 0; i < input->pass_count; i++) {
        c->passes[i].decl = &input->passes[i];
    }
    qsort(c->passes, input->pass_count, sizeof(*c->passes), pass_compare);
    for (uint32_t i = 0; i < input->pass_count; i++) {
        const uint32_t count = c->passes[i].decl->use_count;
        c->passes[i].consumes = many(c, count, sizeof(uint32_t));
        c->passes[i].makes = many(c, count, sizeof(uint32_t));
        c->passes[i].uses = many(c, count, sizeof(frame_graph_plan_use));
        memset(c->passes[i].consumes, 0xff, count * sizeof(uint32_t)); // NONE
        memset(c->passes[i].makes, 0xff, count * sizeof(uint32_t));
    }
}

// ---- Check what each declaration says by itself.

static bool desc_check(compiler *c, const frame_graph_pass_decl *pass, const frame_graph_use *use)
{
    const frame_graph_resource_desc *const desc = &use->desc;
    switch (desc->kind) {
    case FRAME_GRAPH_BUFFER:
        return desc->size ||
               fail(c, "Pass \"%s\" creates the buffer \"%s\" with a size of zero.", pass->name, use->makes);
    case FRAME_GRAPH_IMAGE:
        if (desc->format == VK_FORMAT_UNDEFINED) {
            return fail(c, "Pass \"%s\" creates the image \"%s\" without a format.", pass->name, use->makes);
        }
        return (desc->width && desc->height) || fail(c, "Pass \"%s\" creates the image \"%s\" of %ux%u pixels.",
                                                     pass->name, use->makes, desc->width, desc->height);
    case FRAME_GRAPH_ACCELERATION:
        return fail(c,
                    "Pass \"%s\" creates the acceleration structure \"%s\"; acceleration structures can only be "
                    "imported and modified.",
                    pass->name, use->makes);
    }
    return fail(c, "Pass \"%s\" creates \"%s\" of an unknown kind.", pass->name, use->makes);
}

static bool use_check(compiler *c, const frame_graph_pass_decl *pass, const frame_graph_use *use)
{
    const bool makes = use->kind == FRAME_GRAPH_USE_CREATE || use->kind == FRAME_GRAPH_USE_MODIFY;
    const char *const name = use->kind == FRAME_GRAPH_USE_CREATE ? use->makes : use->name;
    if ((makes && !name_is_well_formed(use->makes)) ||
        (use->kind != FRAME_GRAPH_USE_CREATE && (!name || !alternatives_are_well_formed(name)))) {
        return fail(c, "Pass \"%s\" %s \"%s\", which is no well-formed name.", pass->name, USE_VERBS[use->kind],
                    makes ? (use->makes ? use->makes : "") : (name ? name : ""));
    }
    const frame_graph_access_info *const info = frame_graph_access_describe(use->access);
    if (info->write != makes || use->access == ACCESS_NONE) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which %s.", pass->name, USE_VERBS[use->kind],
                    name, info->name, info->write ? "writes" : "does not write");
    }
    if (!(info->pass_kinds & 1u << pass->kind)) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which a %s pass cannot make.", pass->name,
                    USE_VERBS[use->kind], name, info->name, PASS_KINDS[pass->kind]);
    }
    if (use->clear && (use->kind != FRAME_GRAPH_USE_CREATE || !access_is_attachment(use->access))) {
        return fail(c, "Pass \"%s\" clears \"%s\", which it does not create as an attachment.", pass->name, name);
    }
    return use->kind != FRAME_GRAPH_USE_CREATE || desc_check(c, pass, use);
}

static bool declarations_check(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        const frame_graph_pass_decl *const pass = c->passes[p].decl;
        for (uint32_t u = 0; u < pass->use_count; u++) {
            if (!use_check(c, pass, &pass->uses[u])) {
                return false;
            }
        }
    }
    for (uint32_t i = 0; i < c->input->import_count; i++) {
        if (!name_is_well_formed(c->input->imports[i].name)) {
            return fail(c, "An import is called \"%s\", which is no well-formed name.", c->input->imports[i].name);
        }
    }
    return true;
}

// ---- Versions: collect every name that is made, and find which name each use means.

static int version_compare(const void *left, const void *right)
{
    const version *const a = left, *const b = right;
    const int name = strcmp(a->name, b->name);
    // Imports (pass NONE) come last; so the order of makers in messages is fixed.
    return name ? name : a->pass != b->pass ? (a->pass < b->pass ? -1 : 1) : (int)a->use - (int)b->use;
}

static void versions_collect(compiler *c)
{
    uint32_t capacity = c->input->import_count;
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        capacity += c->passes[p].decl->use_count;
    }
    c->versions = many(c, capacity, sizeof(*c->versions));
    for (uint32_t i = 0; i < c->input->import_count; i++) {
        c->versions[c->version_count++] =
            (version){.name = c->input->imports[i].name, .import = i, .pass = NONE, .exists = true};
    }
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        for (uint32_t u = 0; u < c->passes[p].decl->use_count; u++) {
            const frame_graph_use *const use = &c->passes[p].decl->uses[u];
            if (use->kind == FRAME_GRAPH_USE_CREATE || use->kind == FRAME_GRAPH_USE_MODIFY) {
                c->versions[c->version_count++] =
                    (version){.name = use->makes,
                              .import = NONE,
                              .pass = p,
                              .use = u,
                              .exists = use->kind == FRAME_GRAPH_USE_CREATE || !alternatives_are_optional(use->name)};
            }
        }
    }
    qsort(c->versions, c->version_count, sizeof(*c->versions), version_compare);
    for (uint32_t v = 0; v < c->version_count; v++) {
        version *const version = &c->versions[v];
        version->source = version->modifier = version->resource = NONE;
        version->root = v;
        if (version->pass != NONE) {
            c->passes[version->pass].makes[version->use] = v;
        } else {
            version->after = c->input->imports[version->import].after;
        }
    }
}

static uint32_t version_find(const compiler *c, span name)
{
    uint32_t low = 0;
    for (uint32_t high = c->version_count; low < high;) {
        const uint32_t middle = low + (high - low) / 2;
        if (span_compare(name, c->versions[middle].name) > 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    for (; low < c->version_count && span_compare(name, c->versions[low].name) == 0; low++) {
        if (c->versions[low].exists) {
            return low;
        }
    }
    return NONE;
}

static uint32_t version_find_alternative(const compiler *c, const char *alternatives)
{
    span name;
    for (const char *rest = alternatives; span_next(&rest, &name);) {
        const uint32_t found = version_find(c, name);
        if (found != NONE) {
            return found;
        }
    }
    return NONE;
}

// An optional modification makes its version only if what it modifies exists, which may again be optional.
static void versions_settle(compiler *c)
{
    for (bool changed = true; changed;) {
        changed = false;
        for (uint32_t v = 0; v < c->version_count; v++) {
            version *const version = &c->versions[v];
            if (!version->exists &&
                version_find_alternative(c, c->passes[version->pass].decl->uses[version->use].name) != NONE) {
                version->exists = changed = true;
            }
        }
    }
    for (uint32_t v = 0; v < c->version_count; v++) {
        if (!c->versions[v].exists) {
            c->passes[c->versions[v].pass].makes[c->versions[v].use] = NONE;
        }
    }
}

static const char *maker_text(compiler *c, const version *version)
{
    return version->import != NONE ? "an import"
                                   : arena_printf(c->arena, "pass \"%s\"", c->passes[version->pass].decl->name);
}

static bool makers_check(compiler *c)
{
    const version *last = NULL;
    for (uint32_t v = 0; v < c->version_count; v++) {
        const version *const version = &c->versions[v];
        if (!version->exists) {
            continue;
        }
        if (last && strcmp(last->name, version->name) == 0) {
            return fail(c, "\"%s\" has two makers: %s and %s.", version->name, maker_text(c, last),
                        maker_text(c, version));
        }
        last = version;
    }
    return true;
}

static bool use_resolve(compiler *c, uint32_t pass, uint32_t index)
{
    const frame_graph_pass_decl *const decl = c->passes[pass].decl;
    const frame_graph_use *const use = &decl->uses[index];
    if (use->kind == FRAME_GRAPH_USE_CREATE) {
        return true;
    }
    const uint32_t found = version_find_alternative(c, use->name);
    if (found == NONE) {
        return alternatives_are_optional(use->name) ||
               fail(c, "Pass \"%s\" %s \"%s\", which nothing makes.", decl->name, USE_VERBS[use->kind], use->name);
    }
    c->passes[pass].consumes[index] = found;
    if (use->kind == FRAME_GRAPH_USE_MODIFY) {
        version *const source = &c->versions[found];
        if (source->modifier != NONE) {
            return fail(c, "\"%s\" has two modifiers: pass \"%s\" and pass \"%s\".", source->name,
                        c->passes[source->modifier].decl->name, decl->name);
        }
        source->modifier = pass;
        c->versions[c->passes[pass].makes[index]].source = found;
    }
    return true;
}

static bool names_resolve(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        for (uint32_t u = 0; u < c->passes[p].decl->use_count; u++) {
            if (!use_resolve(c, p, u)) {
                return false;
            }
        }
    }
    return true;
}

// Finds the first version of every chain. Only a pass that modifies what it makes of it has no first version.
static bool chains_find(compiler *c)
{
    for (uint32_t v = 0; v < c->version_count; v++) {
        uint32_t root = v;
        for (uint32_t steps = 0; c->versions[root].source != NONE; steps++) {
            if (steps > c->version_count) {
                return fail(c, "\"%s\" is made by modifications only, by pass \"%s\" among others: no pass creates it.",
                            c->versions[v].name, c->passes[c->versions[v].pass].decl->name);
            }
            root = c->versions[root].source;
        }
        c->versions[v].root = root;
    }
    return true;
}

// ---- Check what uses mean for the resource that they came to.

static bool use_fit_check(compiler *c, const node *pass, uint32_t index)
{
    const frame_graph_use *const use = &pass->decl->uses[index];
    const uint32_t v = pass->consumes[index] != NONE ? pass->consumes[index] : pass->makes[index];
    if (v == NONE) {
        return true;
    }
    const char *const pass_name = pass->decl->name, *const verb = USE_VERBS[use->kind],
                      *const name = c->versions[v].name;
    const frame_graph_resource_desc *const desc = version_desc(c, v);
    const frame_graph_access_info *const info = frame_graph_access_describe(use->access);
    if (!(info->resource_kinds & 1u << desc->kind)) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which is not for a resource of kind %s.",
                    pass_name, verb, name, info->name, RESOURCE_KINDS[desc->kind]);
    }
    const version *const version = &c->versions[v];
    if (pass->decl->kind == FRAME_GRAPH_HOST && !desc->host && !version_is_imported(c, v)) {
        return fail(c, "The host pass \"%s\" %s \"%s\", which is not in host-visible memory.", pass_name, verb, name);
    }
    if (use->kind == FRAME_GRAPH_USE_READ && version->import != NONE &&
        c->input->imports[version->import].before == ACCESS_NONE) {
        return fail(c, "Pass \"%s\" reads the import \"%s\", whose contents are undefined.", pass_name, name);
    }
    if (use->kind != FRAME_GRAPH_USE_PREVIOUS) {
        return true;
    }
    if (version_is_imported(c, v)) {
        return fail(c, "Pass \"%s\" reads last frame's \"%s\", but the graph keeps no history of imports.", pass_name,
                    name);
    }
    return version->modifier == NONE ||
           fail(c, "Pass \"%s\" reads last frame's \"%s\", but pass \"%s\" modifies it before the frame ends.",
                pass_name, name, c->passes[version->modifier].decl->name);
}

static uint32_t use_root(const compiler *c, const node *pass, uint32_t index)
{
    const uint32_t v = pass->makes[index] != NONE ? pass->makes[index] : pass->consumes[index];
    return v == NONE ? NONE : c->versions[v].root;
}

static bool uses_are_of_one_object(const compiler *c, const node *pass, uint32_t a, uint32_t b)
{
    const frame_graph_use *const uses = pass->decl->uses;
    return use_root(c, pass, a) == use_root(c, pass, b) &&
           (uses[a].kind == FRAME_GRAPH_USE_PREVIOUS) == (uses[b].kind == FRAME_GRAPH_USE_PREVIOUS);
}

static bool layouts_check(compiler *c, const node *pass)
{
    for (uint32_t a = 0; a < pass->decl->use_count; a++) {
        const uint32_t root = use_root(c, pass, a);
        if (root == NONE || version_desc(c, root)->kind != FRAME_GRAPH_IMAGE) {
            continue;
        }
        for (uint32_t b = a + 1; b < pass->decl->use_count; b++) {
            const frame_graph_access_info *const first = frame_graph_access_describe(pass->decl->uses[a].access);
            const frame_graph_access_info *const second = frame_graph_access_describe(pass->decl->uses[b].access);
            if (uses_are_of_one_object(c, pass, a, b) && first->layout != second->layout) {
                return fail(c, "Pass \"%s\" uses the image \"%s\" in two layouts: for \"%s\" and for \"%s\".",
                            pass->decl->name, c->versions[root].name, first->name, second->name);
            }
        }
    }
    return true;
}

static bool attachments_check(compiler *c, const node *pass)
{
    enum { COLORS_MAX = 8 };
    uint32_t first = NONE, colors = 0, depths = 0;
    for (uint32_t u = 0; u < pass->decl->use_count; u++) {
        const uint32_t root = use_root(c, pass, u);
        const frame_graph_use *const use = &pass->decl->uses[u];
        if (root == NONE || !access_is_attachment(use->access)) {
            continue;
        }
        if (use->kind == FRAME_GRAPH_USE_PREVIOUS) {
            return fail(c, "Pass \"%s\" uses last frame's \"%s\" as an attachment.", pass->decl->name,
                        c->versions[root].name);
        }
        *(use->access == ACCESS_COLOR_ATTACHMENT ? &colors : &depths) += 1;
        first = first == NONE ? root : first;
        const frame_graph_resource_desc *const a = version_desc(c, first), *const b = version_desc(c, root);
        if (a->width != b->width || a->height != b->height) {
            return fail(c, "Pass \"%s\" has attachments of different sizes: \"%s\" is %ux%u and \"%s\" is %ux%u.",
                        pass->decl->name, c->versions[first].name, a->width, a->height, c->versions[root].name,
                        b->width, b->height);
        }
    }
    if (colors > COLORS_MAX || depths > 1) {
        return fail(c, "Pass \"%s\" has %u color and %u depth attachments; at most %u and 1 are possible.",
                    pass->decl->name, colors, depths, COLORS_MAX);
    }
    return pass->decl->kind != FRAME_GRAPH_GRAPHICS || first != NONE ||
           fail(c, "The graphics pass \"%s\" has no attachment.", pass->decl->name);
}

static bool uses_fit_check(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        const node *const pass = &c->passes[p];
        for (uint32_t u = 0; u < pass->decl->use_count; u++) {
            if (!use_fit_check(c, pass, u)) {
                return false;
            }
        }
        if (!layouts_check(c, pass) || !attachments_check(c, pass)) {
            return false;
        }
    }
    return true;
}

static bool imports_check(compiler *c)
{
    for (uint32_t i = 0; i < c->input->import_count; i++) {
        const frame_graph_import_decl *const import = &c->input->imports[i];
        const frame_graph_access states[] = {import->before, import->after};
        for (uint32_t s = 0; s < countof(states); s++) {
            const frame_graph_access_info *const info = frame_graph_access_describe(states[s]);
            if (states[s] != ACCESS_NONE && !(info->resource_kinds & 1u << import->desc.kind)) {
                return fail(c, "The import \"%s\" is in the state \"%s\" %s, which is not for a resource of kind %s.",
                            import->name, info->name, s ? "after the frame" : "before it",
                            RESOURCE_KINDS[import->desc.kind]);
            }
        }
    }
    return true;
}

static bool export_resolve(compiler *c, const frame_graph_export_decl *decl)
{
    if (!decl->name || !alternatives_are_well_formed(decl->name)) {
        return fail(c, "An export is called \"%s\", which is no well-formed name.", decl->name ? decl->name : "");
    }
    const uint32_t v = version_find_alternative(c, decl->name);
    if (v == NONE) {
        return alternatives_are_optional(decl->name) ||
               fail(c, "\"%s\" is exported, but nothing makes it.", decl->name);
    }
    version *const version = &c->versions[v];
    if (version->modifier != NONE) {
        return fail(c, "\"%s\" is exported, but pass \"%s\" modifies it before the frame ends.", version->name,
                    c->passes[version->modifier].decl->name);
    }
    version->exported = true;
    if (decl->after == ACCESS_NONE) {
        return true;
    }
    frame_graph_access *const after = &c->versions[version->root].after;
    const frame_graph_access_info *const info = frame_graph_access_describe(decl->after);
    if (!(info->resource_kinds & 1u << version_desc(c, v)->kind)) {
        return fail(c, "\"%s\" is exported in the state \"%s\", which is not for a resource of kind %s.", version->name,
                    info->name, RESOURCE_KINDS[version_desc(c, v)->kind]);
    }
    if (*after != ACCESS_NONE && *after != decl->after) {
        return fail(c, "\"%s\" is to be left in two states: \"%s\" and \"%s\".", version->name,
                    frame_graph_access_describe(*after)->name, info->name);
    }
    *after = decl->after;
    return true;
}

static bool exports_resolve(compiler *c)
{
    for (uint32_t e = 0; e < c->input->export_count; e++) {
        if (!export_resolve(c, &c->input->exports[e])) {
            return false;
        }
    }
    return true;
}

// ---- Order

// Counts while the pass has no room for its edges yet, and fills them in when it has.
static void edge_add(node *pass, uint32_t before, uint32_t version, bool overwrites)
{
    if (pass->edges) {
        pass->edges[pass->edge_count] = (edge){.before = before, .version = version, .overwrites = overwrites};
    }
    pass->edge_count++;
}

// A pass runs after the makers of what it consumes, and after all other readers of what it modifies.
static void edges_visit(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        for (uint32_t u = 0; u < c->passes[p].decl->use_count; u++) {
            const uint32_t v = c->passes[p].consumes[u];
            if (v == NONE || c->passes[p].decl->uses[u].kind == FRAME_GRAPH_USE_PREVIOUS) {
                continue;
            }
            const uint32_t maker = c->versions[v].pass, modifier = c->versions[v].modifier;
            if (maker != NONE && maker != p) {
                edge_add(&c->passes[p], maker, v, false);
            }
            if (modifier != NONE && modifier != p) {
                edge_add(&c->passes[modifier], p, v, true);
            }
        }
    }
}

static void edges_build(compiler *c)
{
    edges_visit(c);
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        c->passes[p].edges = many(c, c->passes[p].edge_count, sizeof(edge));
        c->passes[p].edge_count = 0;
    }
    edges_visit(c);
}

static bool cycle_fail(compiler *c, uint32_t first)
{
    uint32_t start = 0;
    while (c->stack[start] != first) {
        start++;
    }
    const char *text = "";
    for (uint32_t i = start; i < c->stack_count; i++) {
        const node *const pass = &c->passes[c->stack[i]];
        const uint32_t before = i + 1 < c->stack_count ? c->stack[i + 1] : first;
        const edge *edge = pass->edges;
        while (edge->before != before) {
            edge++;
        }
        text = arena_printf(c->arena,
                            edge->overwrites ? "%s%spass \"%s\" modifies \"%s\" after it is read by pass \"%s\""
                                             : "%s%spass \"%s\" needs \"%s\" of pass \"%s\"",
                            text, *text ? ", " : "", pass->decl->name, c->versions[edge->version].name,
                            c->passes[before].decl->name);
    }
    return fail(c, "Passes wait for each other in a cycle: %s.", text);
}

// Appends the pass to the order, behind all that must come before it.
static bool pass_visit(compiler *c, uint32_t index)
{
    node *const pass = &c->passes[index];
    pass->visit = OPEN;
    c->stack[c->stack_count++] = index;
    pass->depth = 0;
    for (uint32_t e = 0; e < pass->edge_count; e++) {
        node *const before = &c->passes[pass->edges[e].before];
        if (!before->live) {
            continue;
        }
        if (before->visit == OPEN) {
            return cycle_fail(c, pass->edges[e].before);
        }
        if (before->visit == UNSEEN && !pass_visit(c, pass->edges[e].before)) {
            return false;
        }
        pass->depth = max_u32(pass->depth, before->depth + 1);
    }
    pass->visit = DONE;
    c->stack_count--;
    c->order[c->order_count++] = index;
    return true;
}

// Each live pass comes right behind what it needs, so that lifetimes are short: depth first from the passes that
// nothing waits for. The others are unseen after that only when they wait for each other.
static bool order_find(compiler *c)
{
    c->order_count = c->stack_count = 0;
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        c->passes[p].visit = UNSEEN;
        c->passes[p].has_successor = false;
    }
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        for (uint32_t e = 0; c->passes[p].live && e < c->passes[p].edge_count; e++) {
            c->passes[c->passes[p].edges[e].before].has_successor = true;
        }
    }
    for (int sinks = 1; sinks >= 0; sinks--) {
        for (uint32_t p = 0; p < c->input->pass_count; p++) {
            const node *const pass = &c->passes[p];
            const bool turn = pass->live && pass->visit == UNSEEN && pass->has_successor != sinks;
            if (turn && !pass_visit(c, p)) {
                return false;
            }
        }
    }
    return true;
}

// Orders all passes, those that will be culled too, so that a cycle is an error whether it is needed or not.
static bool cycles_check(compiler *c)
{
    c->order = many(c, c->input->pass_count, sizeof(*c->order));
    c->stack = many(c, c->input->pass_count, sizeof(*c->stack));
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        c->passes[p].live = true;
    }
    return order_find(c);
}

// Of what a pass waits for, the longest chain first: what it needs of short ones is then made late and lives briefly.
static void edges_sort_deepest_first(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        edge *const edges = c->passes[p].edges;
        for (uint32_t i = 1; i < c->passes[p].edge_count; i++) {
            const edge moved = edges[i];
            uint32_t place = i;
            for (; place > 0 && c->passes[edges[place - 1].before].depth < c->passes[moved.before].depth; place--) {
                edges[place] = edges[place - 1];
            }
            edges[place] = moved;
        }
    }
}

// ---- Cull

static void pass_keep(compiler *c, uint32_t index)
{
    node *const pass = &c->passes[index];
    if (pass->live) {
        return;
    }
    pass->live = true;
    for (uint32_t u = 0; u < pass->decl->use_count; u++) {
        const uint32_t v = pass->consumes[u];
        if (v != NONE && c->versions[v].pass != NONE) {
            pass_keep(c, c->versions[v].pass);
        }
    }
}

static bool pass_has_effect(const compiler *c, const node *pass)
{
    for (uint32_t u = 0; u < pass->decl->use_count; u++) {
        const uint32_t v = pass->makes[u];
        if (v != NONE && (c->versions[v].exported || version_is_imported(c, v))) {
            return true;
        }
    }
    return pass->decl->keep || c->input->keep_all;
}

static void passes_cull(compiler *c)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        c->passes[p].live = false;
    }
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        if (pass_has_effect(c, &c->passes[p])) {
            pass_keep(c, p);
        }
    }
}

// Another pass than the maker that consumes the version, or NONE.
static uint32_t version_consumer(const compiler *c, uint32_t v)
{
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        for (uint32_t u = 0; p != c->versions[v].pass && u < c->passes[p].decl->use_count; u++) {
            if (c->passes[p].consumes[u] == v) {
                return p;
            }
        }
    }
    return NONE;
}

static const char *cull_reason(compiler *c, const node *pass)
{
    const char *text = "";
    for (uint32_t u = 0; u < pass->decl->use_count; u++) {
        const uint32_t v = pass->makes[u];
        if (v == NONE) {
            continue;
        }
        const uint32_t consumer = version_consumer(c, v);
        const char *const and = *text ? ", and " : "";
        text = consumer == NONE ? arena_printf(c->arena, "%s%snobody reads \"%s\"", text, and, c->versions[v].name)
                                : arena_printf(c->arena, "%s%s\"%s\" is used only by passes that are culled (\"%s\")",
                                               text, and, c->versions[v].name, c->passes[consumer].decl->name);
    }
    return arena_printf(c->arena, "Pass \"%s\" is culled: %s.", pass->decl->name,
                        *text ? text : "it makes nothing and is not marked to be kept");
}

static void culled_report(compiler *c)
{
    c->plan->culled = many(c, c->input->pass_count, sizeof(*c->plan->culled));
    for (uint32_t p = 0; p < c->input->pass_count; p++) {
        const node *const pass = &c->passes[p];
        if (!pass->live) {
            c->plan->culled[c->plan->culled_count++] =
                (frame_graph_culled){.pass = (uint32_t)(pass->decl - c->input->passes), .why = cull_reason(c, pass)};
        }
    }
}

// ---- Resources and their lifetimes

// What has happened to a resource so far, while barriers are placed.
typedef struct resource_state {
    VkImageLayout layout;
    VkPipelineStageFlags2 write_stages; // the last write or change of layout
    VkAccessFlags2 write_mask; // 0 for a change of layout: barriers make those available by themselves
    VkPipelineStageFlags2 read_stages; // since then
    VkAccessFlags2 visible[32]; // since then, to each stage (by bit)
} resource_state;

// What the plan's resource needs while it is compiled.
typedef struct chain {
    uint32_t root; // version
    uint32_t predecessor; // the resource that had its slot before
    resource_state state;
    resource_state previous; // of the other object
    frame_graph_barrier *previous_barrier; // the first one, NULL before it is placed
} chain;

static VkFlags access_usage(frame_graph_resource_kind kind, frame_graph_access access)
{
    const frame_graph_access_info *const info = frame_graph_access_describe(access);
    return kind == FRAME_GRAPH_IMAGE ? info->image_usage : kind == FRAME_GRAPH_BUFFER ? info->buffer_usage : 0;
}

static void resource_add(compiler *c, uint32_t root)
{
    const uint32_t index = c->plan->resource_count++;
    const frame_graph_resource_desc *const desc = version_desc(c, root);
    c->versions[root].resource = index;
    c->chains[index] = (chain){.root = root, .predecessor = NONE};
    c->plan->resources[index] = (frame_graph_plan_resource){
        .name = c->versions[root].name,
        .desc = *desc,
        .usage = access_usage(desc->kind, c->versions[root].after),
        .import = c->versions[root].import,
        .slot = NONE,
        .first = NONE,
        .last = NONE,
    };
}

// Imports come first, by name; then what passes create, in their order.
static void resources_collect(compiler *c)
{
    c->plan->resources = many(c, c->version_count, sizeof(*c->plan->resources));
    c->chains = many(c, c->version_count, sizeof(*c->chains));
    for (uint32_t v = 0; v < c->version_count; v++) {
        if (c->versions[v].import != NONE) {
            resource_add(c, v);
        }
    }
    for (uint32_t i = 0; i < c->order_count; i++) {
        const node *const pass = &c->passes[c->order[i]];
        for (uint32_t u = 0; u < pass->decl->use_count; u++) {
            if (pass->decl->uses[u].kind == FRAME_GRAPH_USE_CREATE) {
                resource_add(c, pass->makes[u]);
            }
        }
    }
}

static void use_place(compiler *c, uint32_t position, uint32_t index)
{
    node *const pass = &c->passes[c->order[position]];
    const uint32_t root = use_root(c, pass, index);
    if (root == NONE) {
        pass->uses[index].resource = NONE;
        return;
    }
    const frame_graph_use *const use = &pass->decl->uses[index];
    const uint32_t r = c->versions[root].resource, consumed = pass->consumes[index];
    frame_graph_plan_resource *const resource = &c->plan->resources[r];
    const bool previous = use->kind == FRAME_GRAPH_USE_PREVIOUS;
    pass->uses[index] = (frame_graph_plan_use){.resource = r, .previous = previous};
    resource->usage |= access_usage(resource->desc.kind, use->access);
    if (previous) {
        resource->history = true;
        c->versions[consumed].previous_read = true;
        return;
    }
    resource->first = min_u32(resource->first, position); // NONE is the largest
    resource->last = position;
    if (consumed != NONE && c->versions[consumed].pass != c->order[position]) {
        c->versions[consumed].consumed = true;
    }
}

static void uses_place(compiler *c)
{
    for (uint32_t i = 0; i < c->order_count; i++) {
        for (uint32_t u = 0; u < c->passes[c->order[i]].decl->use_count; u++) {
            use_place(c, i, u);
        }
    }
    for (uint32_t v = 0; v < c->version_count; v++) {
        if (c->versions[v].exported) {
            frame_graph_plan_resource *const resource = &c->plan->resources[c->versions[c->versions[v].root].resource];
            resource->exported = true;
            resource->last = resource->first == NONE ? NONE : c->order_count - 1;
        }
    }
}

// ---- Slots

static bool slot_is_free(const compiler *c, uint32_t slot, const uint32_t *occupants,
                         const frame_graph_plan_resource *resource, const VkMemoryRequirements *needs)
{
    const frame_graph_slot *const candidate = &c->plan->slots[slot];
    return candidate->kind == resource->desc.kind && candidate->host == resource->desc.host &&
           c->plan->resources[occupants[slot]].last < resource->first &&
           (candidate->requirements.memoryTypeBits & needs->memoryTypeBits);
}

// The free slot that must grow least; among those that need not grow, the smallest.
static uint32_t slot_choose(const compiler *c, const uint32_t *occupants, const frame_graph_plan_resource *resource,
                            const VkMemoryRequirements *needs)
{
    uint32_t best = NONE;
    VkDeviceSize best_growth = 0, best_size = 0;
    for (uint32_t s = 0; s < c->plan->slot_count; s++) {
        if (!slot_is_free(c, s, occupants, resource, needs)) {
            continue;
        }
        const VkDeviceSize size = c->plan->slots[s].requirements.size;
        const VkDeviceSize growth = size < needs->size ? needs->size - size : 0;
        if (best == NONE || growth < best_growth || (growth == best_growth && size < best_size)) {
            best = s;
            best_growth = growth;
            best_size = size;
        }
    }
    return best;
}

static void slots_assign(compiler *c)
{
    frame_graph_plan *const plan = c->plan;
    plan->slots = many(c, plan->resource_count, sizeof(*plan->slots));
    uint32_t *const occupants = many(c, plan->resource_count, sizeof(*occupants));
    for (uint32_t r = 0; r < plan->resource_count; r++) {
        frame_graph_plan_resource *const resource = &plan->resources[r];
        if (resource->import != NONE || resource->history) {
            continue;
        }
        const VkMemoryRequirements needs = c->input->measure(&resource->desc, resource->usage, c->input->measure_user);
        resource->slot = slot_choose(c, occupants, resource, &needs);
        if (resource->slot == NONE) {
            resource->slot = plan->slot_count++;
            plan->slots[resource->slot] =
                (frame_graph_slot){.requirements = needs, .kind = resource->desc.kind, .host = resource->desc.host};
        } else {
            VkMemoryRequirements *const shared = &plan->slots[resource->slot].requirements;
            shared->size = shared->size > needs.size ? shared->size : needs.size;
            shared->alignment = shared->alignment > needs.alignment ? shared->alignment : needs.alignment;
            shared->memoryTypeBits &= needs.memoryTypeBits;
            c->chains[r].predecessor = occupants[resource->slot];
        }
        occupants[resource->slot] = r;
    }
}

// ---- Load and store operations

static VkAttachmentLoadOp use_load(const compiler *c, const frame_graph_use *use, uint32_t consumed)
{
    if (use->kind == FRAME_GRAPH_USE_CREATE) {
        return use->clear ? VK_ATTACHMENT_LOAD_OP_CLEAR : VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    }
    const uint32_t import = c->versions[consumed].import;
    return import != NONE && c->input->imports[import].before == ACCESS_NONE ? VK_ATTACHMENT_LOAD_OP_DONT_CARE
                                                                             : VK_ATTACHMENT_LOAD_OP_LOAD;
}

static VkAttachmentStoreOp use_store(const compiler *c, uint32_t made)
{
    if (made == NONE) {
        return VK_ATTACHMENT_STORE_OP_NONE; // only tested: storing would be a write
    }
    const version *const version = &c->versions[made];
    return version->consumed || version->exported || version->previous_read || version_is_imported(c, made)
               ? VK_ATTACHMENT_STORE_OP_STORE
               : VK_ATTACHMENT_STORE_OP_DONT_CARE;
}

static void attachment_operations_derive(compiler *c)
{
    for (uint32_t i = 0; i < c->order_count; i++) {
        const node *const pass = &c->passes[c->order[i]];
        for (uint32_t u = 0; u < pass->decl->use_count; u++) {
            const frame_graph_use *const use = &pass->decl->uses[u];
            if (access_is_attachment(use->access) && pass->uses[u].resource != NONE) {
                pass->uses[u].load = use_load(c, use, pass->consumes[u]);
                pass->uses[u].store = use_store(c, pass->makes[u]);
            }
        }
    }
}

// ---- Barriers

// All that one pass does to one object.
typedef struct access_sum {
    VkPipelineStageFlags2 stages;
    VkAccessFlags2 mask;
    VkImageLayout layout;
    bool write;
} access_sum;

static void access_sum_add(access_sum *sum, frame_graph_access access, VkPipelineStageFlags2 shader_stages)
{
    const frame_graph_access_info *const info = frame_graph_access_describe(access);
    sum->stages |= info->stages | (info->shader ? shader_stages : 0);
    sum->mask |= info->mask;
    sum->layout = info->layout;
    sum->write |= info->write;
}

static bool is_visible(const resource_state *state, const access_sum *sum)
{
    for (uint32_t bit = 0; bit < countof(state->visible); bit++) {
        if ((sum->stages >> bit & 1) && (sum->mask & ~state->visible[bit])) {
            return false;
        }
    }
    return true;
}

// Moves the state past the access. Returns whether that takes a barrier, and which.
//
// A write, and a change of layout, waits for all reads since the last write; each of those has itself waited for that
// write and made it available, so execution is all that is left to order. Without reads it waits for the last write.
// A read needs to wait for the last write only, and only if its stage has not yet seen it.
static bool state_advance(resource_state *state, const access_sum *sum, frame_graph_barrier *barrier)
{
    const bool changes_layout = state->layout != sum->layout;
    const bool exclusive = sum->write || changes_layout;
    const bool after_reads = exclusive && state->read_stages;
    *barrier = (frame_graph_barrier){
        .source_stages = after_reads ? state->read_stages : state->write_stages,
        .source_mask = after_reads ? 0 : state->write_mask,
        .destination_stages = sum->stages,
        .destination_mask = sum->mask,
        .old_layout = state->layout,
        .new_layout = sum->layout,
    };
    const bool ordered = exclusive ? barrier->source_stages == 0 : state->write_stages == 0 || is_visible(state, sum);
    const bool needed = changes_layout || !ordered;
    if (exclusive) {
        *state = (resource_state){
            .layout = sum->layout, .write_stages = sum->stages, .write_mask = sum->write ? sum->mask & WRITE_MASK : 0};
    }
    if (!sum->write) {
        state->read_stages |= sum->stages;
        for (uint32_t bit = 0; bit < countof(state->visible); bit++) {
            state->visible[bit] |= sum->stages >> bit & 1 ? sum->mask : 0;
        }
    }
    return needed;
}

// As if `access` had just happened, by any shader.
static resource_state state_after(const frame_graph_resource_desc *desc, frame_graph_access access)
{
    access_sum sum = {0};
    access_sum_add(&sum, access, ANY_SHADER);
    sum.layout = desc->kind == FRAME_GRAPH_IMAGE ? sum.layout : VK_IMAGE_LAYOUT_UNDEFINED;
    resource_state state = {.layout = sum.layout, .write_stages = sum.stages};
    if (sum.write) {
        state.write_mask = sum.mask & WRITE_MASK;
        return state;
    }
    state.read_stages = sum.stages;
    for (uint32_t bit = 0; bit < countof(state.visible); bit++) {
        state.visible[bit] = sum.stages >> bit & 1 ? sum.mask : 0;
    }
    return state;
}

static frame_graph_state state_final(const resource_state *state)
{
    return (frame_graph_state){state->read_stages ? state->read_stages : state->write_stages,
                               state->read_stages ? 0 : state->write_mask, state->layout};
}

static void states_init(compiler *c)
{
    for (uint32_t r = 0; r < c->plan->resource_count; r++) {
        const frame_graph_plan_resource *const resource = &c->plan->resources[r];
        c->chains[r].state = state_after(
            &resource->desc, resource->import == NONE ? ACCESS_NONE : c->input->imports[resource->import].before);
    }
}

// The slot's memory may still be in use by its last user, whose contents are of no interest.
static void state_inherit_slot(compiler *c, uint32_t resource)
{
    chain *const chain = &c->chains[resource];
    if (chain->predecessor != NONE) {
        const resource_state *const last = &c->chains[chain->predecessor].state;
        chain->state.write_stages = last->read_stages | last->write_stages;
        chain->state.write_mask = last->write_mask;
    }
}

static access_sum uses_sum(const compiler *c, const node *pass, uint32_t first)
{
    access_sum sum = {0};
    for (uint32_t u = first; u < pass->decl->use_count; u++) {
        if (uses_are_of_one_object(c, pass, first, u)) {
            access_sum_add(&sum, pass->decl->uses[u].access, SHADER_STAGES[pass->decl->kind]);
        }
    }
    if (c->plan->resources[pass->uses[first].resource].desc.kind != FRAME_GRAPH_IMAGE) {
        sum.layout = VK_IMAGE_LAYOUT_UNDEFINED;
    }
    return sum;
}

// The first read of last frame's contents always takes a barrier; its source is filled in by previous_barriers_finish.
static bool previous_advance(chain *chain, const access_sum *sum, frame_graph_barrier *barrier)
{
    if (!chain->previous_barrier) {
        chain->previous_barrier = barrier;
        chain->previous.layout = VK_IMAGE_LAYOUT_MAX_ENUM; // no access is in this one
    }
    return state_advance(&chain->previous, sum, barrier);
}

static void pass_barriers_place(compiler *c, uint32_t position)
{
    const node *const pass = &c->passes[c->order[position]];
    frame_graph_barrier *const barriers = many(c, pass->decl->use_count, sizeof(*barriers));
    uint32_t count = 0;
    for (uint32_t u = 0; u < pass->decl->use_count; u++) {
        uint32_t first = 0;
        while (!uses_are_of_one_object(c, pass, first, u)) {
            first++;
        }
        const uint32_t resource = pass->uses[u].resource;
        if (resource == NONE || first != u) {
            continue;
        }
        const access_sum sum = uses_sum(c, pass, u);
        chain *const chain = &c->chains[resource];
        const bool previous = pass->uses[u].previous;
        if (!previous && c->plan->resources[resource].first == position) {
            state_inherit_slot(c, resource);
        }
        if (previous ? previous_advance(chain, &sum, &barriers[count])
                     : state_advance(&chain->state, &sum, &barriers[count])) {
            barriers[count].resource = resource;
            barriers[count++].previous = previous;
        }
    }
    c->plan->order[position].barriers = barriers;
    c->plan->order[position].barrier_count = count;
}

static void final_barriers_place(compiler *c)
{
    frame_graph_plan *const plan = c->plan;
    frame_graph_barrier *const barriers = many(c, plan->resource_count, sizeof(*barriers));
    for (uint32_t r = 0; r < plan->resource_count; r++) {
        const frame_graph_access after = c->versions[c->chains[r].root].after;
        access_sum sum = {0};
        access_sum_add(&sum, after, ANY_SHADER);
        if (plan->resources[r].desc.kind != FRAME_GRAPH_IMAGE) {
            sum.layout = VK_IMAGE_LAYOUT_UNDEFINED;
        }
        frame_graph_barrier *const barrier = &barriers[plan->final_barrier_count];
        if (after != ACCESS_NONE && state_advance(&c->chains[r].state, &sum, barrier)) {
            barrier->resource = r;
            plan->final_barrier_count++;
        }
        plan->resources[r].final = state_final(&c->chains[r].state);
    }
    plan->final_barriers = barriers;
}

static void previous_barriers_finish(compiler *c)
{
    for (uint32_t r = 0; r < c->plan->resource_count; r++) {
        frame_graph_barrier *const barrier = c->chains[r].previous_barrier;
        if (barrier) {
            const frame_graph_state *const last = &c->plan->resources[r].final;
            barrier->source_stages = last->stages;
            barrier->source_mask = last->mask;
            barrier->old_layout = last->layout;
        }
    }
}

static void barriers_place(compiler *c)
{
    states_init(c);
    for (uint32_t i = 0; i < c->order_count; i++) {
        pass_barriers_place(c, i);
    }
    final_barriers_place(c);
    previous_barriers_finish(c);
}

// ---- Compile

static void plan_order_fill(compiler *c)
{
    c->plan->order = many(c, c->order_count, sizeof(*c->plan->order));
    c->plan->order_count = c->order_count;
    for (uint32_t i = 0; i < c->order_count; i++) {
        const node *const pass = &c->passes[c->order[i]];
        c->plan->order[i].pass = (uint32_t)(pass->decl - c->input->passes);
        c->plan->order[i].uses = pass->uses;
    }
}

// All that can be wrong is found before the first line of the plan is written, and whether a pass is needed or not.
static bool input_check(compiler *c)
{
    declarations_sort(c);
    if (!declarations_check(c) || !imports_check(c)) {
        return false;
    }
    versions_collect(c);
    versions_settle(c);
    if (!makers_check(c) || !names_resolve(c)) {
        return false;
    }
    edges_build(c);
    return cycles_check(c) && chains_find(c) && uses_fit_check(c) && exports_resolve(c);
}

const frame_graph_plan *frame_graph_plan_compile(const frame_graph_input *input, arena *arena, char error[512])
{
    compiler c = {.input = input, .arena = arena, .error = error};
    error[0] = 0;
    if (!input_check(&c)) {
        return NULL;
    }
    c.plan = many(&c, 1, sizeof(*c.plan));
    passes_cull(&c);
    culled_report(&c);
    edges_sort_deepest_first(&c);
    order_find(&c);
    plan_order_fill(&c);
    resources_collect(&c);
    uses_place(&c);
    slots_assign(&c);
    attachment_operations_derive(&c);
    barriers_place(&c);
    return c.plan;
}

// ---- The plan read back

static uint32_t plan_find_name(const frame_graph_plan *plan, const frame_graph_input *input, span name)
{
    for (uint32_t r = 0; r < plan->resource_count; r++) {
        if (plan->resources[r].import != NONE && span_compare(name, plan->resources[r].name) == 0) {
            return r;
        }
    }
    for (uint32_t i = 0; i < plan->order_count; i++) {
        const frame_graph_pass_decl *const pass = &input->passes[plan->order[i].pass];
        for (uint32_t u = 0; u < pass->use_count; u++) {
            if (pass->uses[u].makes && plan->order[i].uses[u].resource != NONE &&
                span_compare(name, pass->uses[u].makes) == 0) {
                return plan->order[i].uses[u].resource;
            }
        }
    }
    return NONE;
}

uint32_t frame_graph_plan_find(const frame_graph_plan *plan, const frame_graph_input *input, const char *name)
{
    span alternative;
    for (const char *rest = name; span_next(&rest, &alternative);) {
        const uint32_t found = plan_find_name(plan, input, alternative);
        if (found != NONE) {
            return found;
        }
    }
    return NONE;
}

typedef struct bit_name {
    uint64_t bit;
    const char *name;
} bit_name;

static const bit_name STAGE_NAMES[] = {
    {VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT, "indirect"},
    {VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT, "vertex"},
    {VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT, "fragment"},
    {VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT, "early tests"},
    {VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT, "late tests"},
    {VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT, "color output"},
    {VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, "compute"},
    {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, "transfer"},
    {VK_PIPELINE_STAGE_2_HOST_BIT, "host"},
    {VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR, "build"},
};

static const bit_name MASK_NAMES[] = {
    {VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT, "indirect read"},
    {VK_ACCESS_2_UNIFORM_READ_BIT, "uniform read"},
    {VK_ACCESS_2_SHADER_READ_BIT, "shader read"},
    {VK_ACCESS_2_SHADER_SAMPLED_READ_BIT, "sampled read"},
    {VK_ACCESS_2_SHADER_STORAGE_READ_BIT, "storage read"},
    {VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT, "storage write"},
    {VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT, "color read"},
    {VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT, "color write"},
    {VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT, "depth read"},
    {VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT, "depth write"},
    {VK_ACCESS_2_TRANSFER_READ_BIT, "transfer read"},
    {VK_ACCESS_2_TRANSFER_WRITE_BIT, "transfer write"},
    {VK_ACCESS_2_HOST_READ_BIT, "host read"},
    {VK_ACCESS_2_HOST_WRITE_BIT, "host write"},
    {VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR, "structure read"},
    {VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR, "structure write"},
};

static const bit_name LAYOUT_NAMES[] = {
    {VK_IMAGE_LAYOUT_UNDEFINED, "undefined"},
    {VK_IMAGE_LAYOUT_GENERAL, "general"},
    {VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, "color attachment"},
    {VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL, "depth attachment"},
    {VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL, "depth read-only"},
    {VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, "shader read-only"},
    {VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, "transfer source"},
    {VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, "transfer destination"},
};

static void bits_print(FILE *out, const bit_name *names, size_t count, uint64_t bits)
{
    const char *separator = "";
    for (size_t i = 0; i < count; i++) {
        if (bits & names[i].bit) {
            fprintf(out, "%s%s", separator, names[i].name);
            separator = "|";
        }
    }
    fputs(*separator ? "" : "none", out);
}

static const char *layout_text(VkImageLayout layout)
{
    for (size_t i = 0; i < countof(LAYOUT_NAMES); i++) {
        if (LAYOUT_NAMES[i].bit == (uint64_t)layout) {
            return LAYOUT_NAMES[i].name;
        }
    }
    return "unknown";
}

static void barrier_print(FILE *out, const frame_graph_plan *plan, const frame_graph_barrier *barrier)
{
    fprintf(out, "       barrier %s\"%s\": ", barrier->previous ? "last frame's " : "",
            plan->resources[barrier->resource].name);
    bits_print(out, STAGE_NAMES, countof(STAGE_NAMES), barrier->source_stages);
    fputs(" (", out);
    bits_print(out, MASK_NAMES, countof(MASK_NAMES), barrier->source_mask);
    fputs(") -> ", out);
    bits_print(out, STAGE_NAMES, countof(STAGE_NAMES), barrier->destination_stages);
    fputs(" (", out);
    bits_print(out, MASK_NAMES, countof(MASK_NAMES), barrier->destination_mask);
    fputs(")", out);
    if (barrier->old_layout != barrier->new_layout) {
        fprintf(out, ", %s -> %s", layout_text(barrier->old_layout), layout_text(barrier->new_layout));
    }
    fputc('\n', out);
}

static const char *load_text(VkAttachmentLoadOp load)
{
    return load == VK_ATTACHMENT_LOAD_OP_LOAD ? "load" : load == VK_ATTACHMENT_LOAD_OP_CLEAR ? "clear" : "undefined";
}

static const char *store_text(VkAttachmentStoreOp store)
{
    return store == VK_ATTACHMENT_STORE_OP_STORE ? "store" : store == VK_ATTACHMENT_STORE_OP_NONE ? "keep" : "discard";
}

static void use_print(FILE *out, const frame_graph_use *use, const frame_graph_plan_use *plan_use)
{
    fprintf(out, "       %s \"%s\"", USE_VERBS[use->kind],
            use->kind == FRAME_GRAPH_USE_CREATE ? use->makes : use->name);
    if (plan_use->resource == NONE) {
        fputs(": absent\n", out);
        return;
    }
    if (use->kind == FRAME_GRAPH_USE_MODIFY) {
        fprintf(out, " into \"%s\"", use->makes);
    }
    fprintf(out, " as %s", frame_graph_access_describe(use->access)->name);
    if (access_is_attachment(use->access)) {
        fprintf(out, ": %s, %s", load_text(plan_use->load), store_text(plan_use->store));
    }
    fputc('\n', out);
}

static void pass_print(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input, uint32_t position)
{
    const frame_graph_plan_pass *const pass = &plan->order[position];
    const frame_graph_pass_decl *const decl = &input->passes[pass->pass];
    fprintf(out, "  %3u  %s (%s)\n", position, decl->name, PASS_KINDS[decl->kind]);
    for (uint32_t b = 0; b < pass->barrier_count; b++) {
        barrier_print(out, plan, &pass->barriers[b]);
    }
    for (uint32_t u = 0; u < decl->use_count; u++) {
        use_print(out, &decl->uses[u], &pass->uses[u]);
    }
}

static void resource_print(FILE *out, const frame_graph_plan_resource *resource)
{
    fprintf(out, "  \"%s\": %s", resource->name, RESOURCE_KINDS[resource->desc.kind]);
    if (resource->desc.kind == FRAME_GRAPH_IMAGE) {
        fprintf(out, " %ux%u, format %d", resource->desc.width, resource->desc.height, (int)resource->desc.format);
    } else {
        fprintf(out, " of %llu bytes", (unsigned long long)resource->desc.size);
    }
    fputs(resource->import != NONE ? ", import" : resource->history ? ", history" : "", out);
    if (resource->slot != NONE) {
        fprintf(out, ", slot %u", resource->slot);
    }
    fputs(resource->exported ? ", exported" : "", out);
    if (resource->first == NONE) {
        fputs(", unused\n", out);
    } else {
        fprintf(out, ", passes %u to %u\n", resource->first, resource->last);
    }
}

static void plan_print(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input)
{
    fputs("passes\n", out);
    for (uint32_t i = 0; i < plan->order_count; i++) {
        pass_print(out, plan, input, i);
    }
    fputs("at the end\n", out);
    for (uint32_t b = 0; b < plan->final_barrier_count; b++) {
        barrier_print(out, plan, &plan->final_barriers[b]);
    }
    fputs("culled\n", out);
    for (uint32_t i = 0; i < plan->culled_count; i++) {
        fprintf(out, "  %s\n", plan->culled[i].why);
    }
    fputs("resources\n", out);
    for (uint32_t r = 0; r < plan->resource_count; r++) {
        resource_print(out, &plan->resources[r]);
    }
    fputs("slots\n", out);
    for (uint32_t s = 0; s < plan->slot_count; s++) {
        const frame_graph_slot *const slot = &plan->slots[s];
        fprintf(out, "  %3u  %s%s of %llu bytes\n", s, slot->host ? "host " : "", RESOURCE_KINDS[slot->kind],
                (unsigned long long)slot->requirements.size);
    }
}

static void pass_edges_print(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input, uint32_t position)
{
    const frame_graph_plan_pass *const pass = &plan->order[position];
    const frame_graph_pass_decl *const decl = &input->passes[pass->pass];
    for (uint32_t u = 0; u < decl->use_count; u++) {
        const frame_graph_use *const use = &decl->uses[u];
        span name;
        for (const char *rest = use->kind == FRAME_GRAPH_USE_CREATE ? NULL : use->name; span_next(&rest, &name);) {
            // The first alternative that is in the plan is the one that was meant.
            if (plan_find_name(plan, input, name) != NONE) {
                fprintf(out, "  \"%.*s\" -> \"pass %u\"%s;\n", (int)name.length, name.text, position,
                        pass->uses[u].previous ? " [style=dashed, label=\"last frame\"]" : "");
                break;
            }
        }
        if (use->makes && pass->uses[u].resource != NONE) {
            fprintf(out, "  \"pass %u\" -> \"%s\";\n", position, use->makes);
        }
    }
}

static void plan_print_dot(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input)
{
    fputs("digraph frame {\n  rankdir=LR;\n  node [shape=ellipse];\n", out);
    for (uint32_t i = 0; i < plan->order_count; i++) {
        const frame_graph_pass_decl *const decl = &input->passes[plan->order[i].pass];
        fprintf(out, "  \"pass %u\" [shape=box, style=filled, label=\"%u %s\\n%s\"];\n", i, i, decl->name,
                PASS_KINDS[decl->kind]);
        pass_edges_print(out, plan, input, i);
    }
    for (uint32_t i = 0; i < plan->culled_count; i++) {
        fprintf(out, "  \"culled %u\" [shape=box, style=dashed, label=\"%s\"];\n", i,
                input->passes[plan->culled[i].pass].name);
    }
    fputs("}\n", out);
}

static char *print_into_arena(void (*print)(FILE *, const frame_graph_plan *, const frame_graph_input *),
                              const frame_graph_plan *plan, const frame_graph_input *input, arena *arena)
{
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    assert(out);
    print(out, plan, input);
    fclose(out);
    char *const copy = arena_strdup(arena, text);
    free(text);
    return copy;
}

char *frame_graph_plan_text(const frame_graph_plan *plan, const frame_graph_input *input, arena *arena)
{
    return print_into_arena(plan_print, plan, input, arena);
}

char *frame_graph_plan_dot(const frame_graph_plan *plan, const frame_graph_input *input, arena *arena)
{
    return print_into_arena(plan_print_dot, plan, input, arena);
}
