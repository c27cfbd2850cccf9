// The pure half of the frame graph: see frame_graph_compile.h. Everything works on passes and imports sorted by name,
// so that the order of registration cannot show in the plan.
#include "frame_graph_compile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = FRAME_GRAPH_NONE };

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
        if (name.length == 0 || (span_compare(name, "-") == 0 && (rest || first))) {
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
    uint32_t use; // by this use
    uint32_t pass; // of that use
    bool exists; // an optional modification makes nothing when what it modifies does not exist
    uint32_t source; // the version that a modification consumes
    uint32_t modifier; // the pass that consumes this version
    uint32_t root; // the first version of the chain: stands for the resource
    uint32_t resource; // roots: in the plan
    frame_graph_access after; // roots: the state to leave the resource in
    bool exported;
    bool consumed; // by another pass that runs, or by one in the next frame
} version;

typedef struct use {
    const frame_graph_use *decl;
    uint32_t pass;
    uint32_t consumes; // the version read or modified
    uint32_t makes; // the version created or the outcome of the modification
} use;

// `before` runs before the pass that owns the edge.
typedef struct edge {
    uint32_t before;
    uint32_t version; // why
    bool overwrites; // because the owner modifies what `before` reads; else because it needs what `before` makes
} edge;

typedef struct node {
    const frame_graph_pass_decl *decl;
    uint32_t first_use, end_use;
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
    uint32_t pass_count;
    use *uses; // of the first pass, of the second, ...
    uint32_t use_count;
    version *versions; // sorted by name
    uint32_t version_count;
    uint32_t *order; // of the live passes
    uint32_t order_count;
    uint32_t *stack; // passes on the way from the sink, while ordering
    uint32_t stack_count;
    frame_graph_plan_use *plan_uses; // parallel to `uses`
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

static const char *pass_name(const compiler *c, uint32_t pass)
{
    return c->passes[pass].decl->name;
}

static const version *version_root(const compiler *c, uint32_t v)
{
    return &c->versions[c->versions[v].root];
}

static const frame_graph_resource_desc *version_desc(const compiler *c, uint32_t v)
{
    const version *const root = version_root(c, v);
    return root->import != NONE ? &c->input->imports[root->import].desc : &c->uses[root->use].decl->desc;
}

static bool version_is_imported(const compiler *c, uint32_t v)
{
    return version_root(c, v)->import != NONE;
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
    c->pass_count = c->input->pass_count;
    c->passes = many(c, c->pass_count, sizeof(*c->passes));
    for (uint32_t p = 0; p < c->pass_count; p++) {
        c->passes[p] = (node){.decl = &c->input->passes[p], .live = true};
        c->use_count += c->input->passes[p].use_count;
    }
    qsort(c->passes, c->pass_count, sizeof(*c->passes), pass_compare);
    c->uses = many(c, c->use_count, sizeof(*c->uses));
    uint32_t end = 0;
    for (uint32_t p = 0; p < c->pass_count; p++) {
        node *const pass = &c->passes[p];
        pass->first_use = end;
        for (uint32_t i = 0; i < pass->decl->use_count; i++) {
            c->uses[end++] = (use){.decl = &pass->decl->uses[i], .pass = p, .consumes = NONE, .makes = NONE};
        }
        pass->end_use = end;
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
    const bool creates = use->kind == FRAME_GRAPH_USE_CREATE, makes = creates || use->kind == FRAME_GRAPH_USE_MODIFY;
    const char *const name = creates ? use->makes : use->name, *const verb = FRAME_GRAPH_USE_VERBS[use->kind];
    if ((makes && !name_is_well_formed(use->makes)) || (!creates && (!name || !alternatives_are_well_formed(name)))) {
        const char *const shown = makes ? use->makes : name;
        return fail(c, "Pass \"%s\" %s \"%s\", which is no well-formed name.", pass->name, verb, shown ? shown : "");
    }
    const frame_graph_access_info *const info = frame_graph_access_describe(use->access);
    if (info->write != makes || use->access == ACCESS_NONE) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which %s.", pass->name, verb, name, info->name,
                    info->write ? "writes" : "does not write");
    }
    if (!(info->pass_kinds & 1u << pass->kind)) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which a %s pass cannot make.", pass->name, verb,
                    name, info->name, FRAME_GRAPH_PASS_KINDS[pass->kind]);
    }
    if (use->clear && (!creates || !info->attachment)) {
        return fail(c, "Pass \"%s\" clears \"%s\", which it does not create as an attachment.", pass->name, name);
    }
    return !creates || desc_check(c, pass, use);
}

static bool declarations_check(compiler *c)
{
    for (uint32_t u = 0; u < c->use_count; u++) {
        if (!use_check(c, c->passes[c->uses[u].pass].decl, c->uses[u].decl)) {
            return false;
        }
    }
    for (uint32_t i = 0; i < c->input->import_count; i++) {
        if (!name_is_well_formed(c->input->imports[i].name)) {
            return fail(c, "An import is called \"%s\", which is no well-formed name.", c->input->imports[i].name);
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
                            FRAME_GRAPH_RESOURCE_KINDS[import->desc.kind]);
            }
        }
    }
    return true;
}

// ---- Versions: collect every name that is made, and find which name each use means.

static int version_compare(const void *left, const void *right)
{
    const version *const a = left, *const b = right;
    const int name = strcmp(a->name, b->name);
    // Imports (use NONE) come last; so the order of makers in messages is fixed.
    return name ? name : (a->use > b->use) - (a->use < b->use);
}

static void versions_collect(compiler *c)
{
    c->versions = many(c, c->input->import_count + c->use_count, sizeof(*c->versions));
    for (uint32_t i = 0; i < c->input->import_count; i++) {
        const frame_graph_import_decl *const decl = &c->input->imports[i];
        c->versions[c->version_count++] =
            (version){.name = decl->name, .import = i, .use = NONE, .pass = NONE, .exists = true, .after = decl->after};
    }
    for (uint32_t u = 0; u < c->use_count; u++) {
        const frame_graph_use *const decl = c->uses[u].decl;
        const bool creates = decl->kind == FRAME_GRAPH_USE_CREATE;
        if (creates || decl->kind == FRAME_GRAPH_USE_MODIFY) {
            c->versions[c->version_count++] = (version){
                .name = decl->makes,
                .import = NONE,
                .use = u,
                .pass = c->uses[u].pass,
                .exists = creates || !alternatives_are_optional(decl->name),
            };
        }
    }
    qsort(c->versions, c->version_count, sizeof(*c->versions), version_compare);
    for (uint32_t v = 0; v < c->version_count; v++) {
        version *const version = &c->versions[v];
        version->source = version->modifier = version->resource = NONE;
        version->root = v;
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
            if (!version->exists && version_find_alternative(c, c->uses[version->use].decl->name) != NONE) {
                version->exists = changed = true;
            }
        }
    }
    for (uint32_t v = 0; v < c->version_count; v++) {
        if (c->versions[v].exists && c->versions[v].use != NONE) {
            c->uses[c->versions[v].use].makes = v;
        }
    }
}

static const char *maker_text(compiler *c, const version *version)
{
    return version->import != NONE ? "an import" : arena_printf(c->arena, "pass \"%s\"", pass_name(c, version->pass));
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

static bool use_resolve(compiler *c, use *use)
{
    const frame_graph_use *const decl = use->decl;
    if (decl->kind == FRAME_GRAPH_USE_CREATE) {
        return true;
    }
    use->consumes = version_find_alternative(c, decl->name);
    if (use->consumes == NONE) {
        return alternatives_are_optional(decl->name) ||
               fail(c, "Pass \"%s\" %s \"%s\", which nothing makes.", pass_name(c, use->pass),
                    FRAME_GRAPH_USE_VERBS[decl->kind], decl->name);
    }
    if (decl->kind == FRAME_GRAPH_USE_MODIFY) {
        version *const source = &c->versions[use->consumes];
        if (source->modifier != NONE) {
            return fail(c, "\"%s\" has two modifiers: pass \"%s\" and pass \"%s\".", source->name,
                        pass_name(c, source->modifier), pass_name(c, use->pass));
        }
        source->modifier = use->pass;
        c->versions[use->makes].source = use->consumes;
    }
    return true;
}

static bool uses_resolve(compiler *c)
{
    for (uint32_t u = 0; u < c->use_count; u++) {
        if (!use_resolve(c, &c->uses[u])) {
            return false;
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
                            c->versions[v].name, pass_name(c, c->versions[v].pass));
            }
            root = c->versions[root].source;
        }
        c->versions[v].root = root;
    }
    return true;
}

// ---- Check what uses mean for the resource that they came to.

static bool use_fit_check(compiler *c, const use *use)
{
    const frame_graph_use *const decl = use->decl;
    const uint32_t v = use->consumes != NONE ? use->consumes : use->makes;
    if (v == NONE) {
        return true;
    }
    const version *const version = &c->versions[v];
    const frame_graph_pass_decl *const pass = c->passes[use->pass].decl;
    const char *const verb = FRAME_GRAPH_USE_VERBS[decl->kind];
    const frame_graph_resource_desc *const desc = version_desc(c, v);
    const frame_graph_access_info *const info = frame_graph_access_describe(decl->access);
    if (!(info->resource_kinds & 1u << desc->kind)) {
        return fail(c, "Pass \"%s\" %s \"%s\" with the access \"%s\", which is not for a resource of kind %s.",
                    pass->name, verb, version->name, info->name, FRAME_GRAPH_RESOURCE_KINDS[desc->kind]);
    }
    if (pass->kind == FRAME_GRAPH_HOST && !desc->host && !version_is_imported(c, v)) {
        return fail(c, "The host pass \"%s\" %s \"%s\", which is not in host-visible memory.", pass->name, verb,
                    version->name);
    }
    if (decl->kind == FRAME_GRAPH_USE_READ && version->import != NONE &&
        c->input->imports[version->import].before == ACCESS_NONE) {
        return fail(c, "Pass \"%s\" reads the import \"%s\", whose contents are undefined.", pass->name, version->name);
    }
    if (decl->kind != FRAME_GRAPH_USE_PREVIOUS) {
        return true;
    }
    if (version_is_imported(c, v)) {
        return fail(c, "Pass \"%s\" reads last frame's \"%s\", but the graph keeps no history of imports.", pass->name,
                    version->name);
    }
    return version->modifier == NONE ||
           fail(c, "Pass \"%s\" reads last frame's \"%s\", but pass \"%s\" modifies it before the frame ends.",
                pass->name, version->name, pass_name(c, version->modifier));
}

static uint32_t use_root(const compiler *c, uint32_t u)
{
    const uint32_t v = c->uses[u].makes != NONE ? c->uses[u].makes : c->uses[u].consumes;
    return v == NONE ? NONE : c->versions[v].root;
}

static bool uses_are_of_one_object(const compiler *c, uint32_t a, uint32_t b)
{
    return use_root(c, a) == use_root(c, b) &&
           (c->uses[a].decl->kind == FRAME_GRAPH_USE_PREVIOUS) == (c->uses[b].decl->kind == FRAME_GRAPH_USE_PREVIOUS);
}

static bool layouts_check(compiler *c, const node *pass)
{
    for (uint32_t a = pass->first_use; a < pass->end_use; a++) {
        const uint32_t root = use_root(c, a);
        if (root == NONE || version_desc(c, root)->kind != FRAME_GRAPH_IMAGE) {
            continue;
        }
        for (uint32_t b = a + 1; b < pass->end_use; b++) {
            const frame_graph_access_info *const first = frame_graph_access_describe(c->uses[a].decl->access);
            const frame_graph_access_info *const second = frame_graph_access_describe(c->uses[b].decl->access);
            if (uses_are_of_one_object(c, a, b) && first->layout != second->layout) {
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
    for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
        const uint32_t root = use_root(c, u);
        const frame_graph_use *const use = c->uses[u].decl;
        if (root == NONE || !frame_graph_access_describe(use->access)->attachment) {
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
    for (uint32_t p = 0; p < c->pass_count; p++) {
        const node *const pass = &c->passes[p];
        for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
            if (!use_fit_check(c, &c->uses[u])) {
                return false;
            }
        }
        if (!layouts_check(c, pass) || !attachments_check(c, pass)) {
            return false;
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
                    pass_name(c, version->modifier));
    }
    version->exported = true;
    if (decl->after == ACCESS_NONE) {
        return true;
    }
    frame_graph_access *const after = &c->versions[version->root].after;
    const frame_graph_access_info *const info = frame_graph_access_describe(decl->after);
    if (!(info->resource_kinds & 1u << version_desc(c, v)->kind)) {
        return fail(c, "\"%s\" is exported in the state \"%s\", which is not for a resource of kind %s.", version->name,
                    info->name, FRAME_GRAPH_RESOURCE_KINDS[version_desc(c, v)->kind]);
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

// A pass runs after the makers of what it consumes, and after all other readers of what it modifies.
static void edges_build(compiler *c)
{
    edge *end = many(c, 2 * c->use_count, sizeof(*end)); // each use makes at most one of either sort
    for (uint32_t p = 0; p < c->pass_count; p++) {
        node *const pass = &c->passes[p];
        pass->edges = end;
        for (const use *use = c->uses; use < c->uses + c->use_count; use++) {
            if (use->consumes == NONE || use->decl->kind == FRAME_GRAPH_USE_PREVIOUS) {
                continue;
            }
            const version *const version = &c->versions[use->consumes];
            if (use->pass == p && version->pass != NONE && version->pass != p) {
                *end++ = (edge){.before = version->pass, .version = use->consumes};
            } else if (use->pass != p && version->modifier == p) {
                *end++ = (edge){.before = use->pass, .version = use->consumes, .overwrites = true};
            }
        }
        pass->edge_count = (uint32_t)(end - pass->edges);
    }
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
                            pass_name(c, before));
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
    c->order = many(c, c->pass_count, sizeof(*c->order));
    c->stack = many(c, c->pass_count, sizeof(*c->stack));
    c->order_count = c->stack_count = 0;
    for (uint32_t p = 0; p < c->pass_count; p++) {
        c->passes[p].visit = UNSEEN;
        c->passes[p].has_successor = false;
    }
    for (uint32_t p = 0; p < c->pass_count; p++) {
        for (uint32_t e = 0; c->passes[p].live && e < c->passes[p].edge_count; e++) {
            c->passes[c->passes[p].edges[e].before].has_successor = true;
        }
    }
    for (int sinks = 1; sinks >= 0; sinks--) {
        for (uint32_t p = 0; p < c->pass_count; p++) {
            const node *const pass = &c->passes[p];
            const bool turn = pass->live && pass->visit == UNSEEN && pass->has_successor != sinks;
            if (turn && !pass_visit(c, p)) {
                return false;
            }
        }
    }
    return true;
}

// Of what a pass waits for, the longest chain first: what it needs of short ones is then made late and lives briefly.
static void edges_sort_deepest_first(compiler *c)
{
    for (uint32_t p = 0; p < c->pass_count; p++) {
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
    for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
        const uint32_t v = c->uses[u].consumes;
        if (v != NONE && c->versions[v].pass != NONE) {
            pass_keep(c, c->versions[v].pass);
        }
    }
}

// What is written to an import stays after the frame; acceleration structures are built anew before they are traced.
static bool version_outlives_frame(const compiler *c, uint32_t v)
{
    return c->versions[v].exported ||
           (version_is_imported(c, v) && version_desc(c, v)->kind != FRAME_GRAPH_ACCELERATION);
}

static bool pass_has_effect(const compiler *c, const node *pass)
{
    for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
        const uint32_t v = c->uses[u].makes;
        if (v != NONE && version_outlives_frame(c, v)) {
            return true;
        }
    }
    return pass->decl->keep || c->input->keep_all;
}

// A use of the version by another pass than its maker, or NULL.
static const use *version_find_consumer(const compiler *c, uint32_t v)
{
    for (const use *use = c->uses; use < c->uses + c->use_count; use++) {
        if (use->consumes == v && use->pass != c->versions[v].pass) {
            return use;
        }
    }
    return NULL;
}

static const char *cull_reason(compiler *c, const node *pass)
{
    const char *text = "";
    for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
        const uint32_t v = c->uses[u].makes;
        if (v == NONE) {
            continue;
        }
        const use *const consumer = version_find_consumer(c, v);
        const char *const name = c->versions[v].name, *const and = *text ? ", and " : "";
        text = consumer ? arena_printf(c->arena, "%s%s\"%s\" is used only by passes that are culled (\"%s\")", text,
                                       and, name, pass_name(c, consumer->pass))
                        : arena_printf(c->arena, "%s%snobody reads \"%s\"", text, and, name);
    }
    return arena_printf(c->arena, "Pass \"%s\" is culled: %s.", pass->decl->name,
                        *text ? text : "it makes nothing and is not marked to be kept");
}

static void passes_cull(compiler *c)
{
    for (uint32_t p = 0; p < c->pass_count; p++) {
        c->passes[p].live = false;
    }
    for (uint32_t p = 0; p < c->pass_count; p++) {
        if (pass_has_effect(c, &c->passes[p])) {
            pass_keep(c, p);
        }
    }
    c->plan->culled = many(c, c->pass_count, sizeof(*c->plan->culled));
    for (uint32_t p = 0; p < c->pass_count; p++) {
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
    frame_graph_barrier *previous_barrier; // the first one; NULL before it is placed
} chain;

static VkFlags access_usage(frame_graph_resource_kind kind, frame_graph_access access)
{
    const frame_graph_access_info *const info = frame_graph_access_describe(access);
    return kind == FRAME_GRAPH_IMAGE ? info->image_usage : kind == FRAME_GRAPH_BUFFER ? info->buffer_usage : 0;
}

static void resource_add(compiler *c, uint32_t root)
{
    version *const version = &c->versions[root];
    const frame_graph_resource_desc *const desc = version_desc(c, root);
    version->resource = c->plan->resource_count++;
    c->chains[version->resource] = (chain){.root = root, .predecessor = NONE};
    c->plan->resources[version->resource] = (frame_graph_plan_resource){
        .name = version->name,
        .desc = *desc,
        .usage = access_usage(desc->kind, version->after),
        .import = version->import,
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
        for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
            if (c->uses[u].decl->kind == FRAME_GRAPH_USE_CREATE) {
                resource_add(c, c->uses[u].makes);
            }
        }
    }
}

static void use_place(compiler *c, uint32_t position, uint32_t u)
{
    const use *const use = &c->uses[u];
    frame_graph_plan_use *const plan_use = &c->plan_uses[u];
    const uint32_t root = use_root(c, u);
    if (root == NONE) {
        plan_use->resource = NONE;
        return;
    }
    plan_use->resource = c->versions[root].resource;
    plan_use->previous = use->decl->kind == FRAME_GRAPH_USE_PREVIOUS;
    frame_graph_plan_resource *const resource = &c->plan->resources[plan_use->resource];
    resource->usage |= access_usage(resource->desc.kind, use->decl->access);
    if (use->consumes != NONE) {
        version *const consumed = &c->versions[use->consumes];
        plan_use->name = consumed->name;
        consumed->consumed |= plan_use->previous || consumed->pass != use->pass;
    }
    if (plan_use->previous) {
        resource->history = true;
    } else {
        resource->first = min_u32(resource->first, position); // NONE is the largest
        resource->last = position;
    }
}

static void uses_place(compiler *c)
{
    c->plan_uses = many(c, c->use_count, sizeof(*c->plan_uses));
    c->plan->order = many(c, c->order_count, sizeof(*c->plan->order));
    c->plan->order_count = c->order_count;
    for (uint32_t i = 0; i < c->order_count; i++) {
        const node *const pass = &c->passes[c->order[i]];
        c->plan->order[i].pass = (uint32_t)(pass->decl - c->input->passes);
        c->plan->order[i].uses = &c->plan_uses[pass->first_use];
        for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
            use_place(c, i, u);
        }
    }
    for (uint32_t v = 0; v < c->version_count; v++) {
        if (c->versions[v].exported) {
            frame_graph_plan_resource *const resource = &c->plan->resources[version_root(c, v)->resource];
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

static VkAttachmentLoadOp use_load(const compiler *c, const use *use)
{
    if (use->decl->kind == FRAME_GRAPH_USE_CREATE) {
        return use->decl->clear ? VK_ATTACHMENT_LOAD_OP_CLEAR : VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    }
    const uint32_t import = c->versions[use->consumes].import;
    return import != NONE && c->input->imports[import].before == ACCESS_NONE ? VK_ATTACHMENT_LOAD_OP_DONT_CARE
                                                                             : VK_ATTACHMENT_LOAD_OP_LOAD;
}

static VkAttachmentStoreOp use_store(const compiler *c, const use *use)
{
    if (use->makes == NONE) {
        return VK_ATTACHMENT_STORE_OP_NONE; // only tested: storing would be a write
    }
    const version *const made = &c->versions[use->makes];
    return made->consumed || made->exported || version_is_imported(c, use->makes) ? VK_ATTACHMENT_STORE_OP_STORE
                                                                                  : VK_ATTACHMENT_STORE_OP_DONT_CARE;
}

static void attachment_operations_derive(compiler *c)
{
    for (uint32_t u = 0; u < c->use_count; u++) {
        const use *const use = &c->uses[u];
        if (c->passes[use->pass].live && c->plan_uses[u].resource != NONE &&
            frame_graph_access_describe(use->decl->access)->attachment) {
            c->plan_uses[u].load = use_load(c, use);
            c->plan_uses[u].store = use_store(c, use);
        }
    }
}

// ---- Barriers

#define GRAPHICS_SHADERS (VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT | VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT)
// Before and after the frame nothing tells which shaders. Not those of ray-tracing pipelines, whose stage may be named
// only where the device has them: frames are waited for, so that none of theirs is still running.
#define ANY_SHADER (GRAPHICS_SHADERS | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT)

static const VkPipelineStageFlags2 SHADER_STAGES[] = {
    [FRAME_GRAPH_GRAPHICS] = GRAPHICS_SHADERS,
    [FRAME_GRAPH_COMPUTE] = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
    [FRAME_GRAPH_TRANSFER] = 0,
    [FRAME_GRAPH_RAY_TRACING] = VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR,
    [FRAME_GRAPH_HOST] = 0,
};

static const VkAccessFlags2 WRITE_MASK = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT |
                                         VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT |
                                         VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_HOST_WRITE_BIT |
                                         VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;

// All that one pass does to one object.
typedef struct access_sum {
    VkPipelineStageFlags2 stages;
    VkAccessFlags2 mask;
    VkImageLayout layout;
    bool write;
} access_sum;

static void access_sum_add(access_sum *sum, frame_graph_resource_kind kind, frame_graph_access access,
                           VkPipelineStageFlags2 shader_stages)
{
    const frame_graph_access_info *const info = frame_graph_access_describe(access);
    sum->stages |= info->stages | (info->shader ? shader_stages : 0);
    sum->mask |= info->mask;
    sum->layout = kind == FRAME_GRAPH_IMAGE ? info->layout : VK_IMAGE_LAYOUT_UNDEFINED;
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
static resource_state state_after(frame_graph_resource_kind kind, frame_graph_access access)
{
    access_sum sum = {0};
    access_sum_add(&sum, kind, access, ANY_SHADER);
    resource_state state = {.layout = sum.layout, .write_stages = sum.stages};
    state_advance(&state, &sum, &(frame_graph_barrier){0});
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
        const uint32_t import = resource->import;
        c->chains[r].state =
            state_after(resource->desc.kind, import == NONE ? ACCESS_NONE : c->input->imports[import].before);
        c->chains[r].previous.layout = VK_IMAGE_LAYOUT_MAX_ENUM; // so that the first read takes a barrier
    }
}

// The slot's memory may still be in use by its last user, whose contents are of no interest.
static void state_inherit_slot(const compiler *c, chain *chain)
{
    if (chain->predecessor != NONE) {
        const resource_state *const last = &c->chains[chain->predecessor].state;
        chain->state.write_stages = last->read_stages | last->write_stages;
        chain->state.write_mask = last->write_mask;
    }
}

static access_sum object_uses_sum(const compiler *c, const node *pass, uint32_t first)
{
    const frame_graph_resource_kind kind = c->plan->resources[c->plan_uses[first].resource].desc.kind;
    access_sum sum = {0};
    for (uint32_t u = first; u < pass->end_use; u++) {
        if (uses_are_of_one_object(c, first, u)) {
            access_sum_add(&sum, kind, c->uses[u].decl->access, SHADER_STAGES[pass->decl->kind]);
        }
    }
    return sum;
}

static void pass_barriers_place(compiler *c, uint32_t position)
{
    const node *const pass = &c->passes[c->order[position]];
    frame_graph_barrier *const barriers = many(c, pass->decl->use_count, sizeof(*barriers)), *end = barriers;
    for (uint32_t u = pass->first_use; u < pass->end_use; u++) {
        uint32_t first = pass->first_use;
        while (!uses_are_of_one_object(c, first, u)) {
            first++;
        }
        const frame_graph_plan_use *const use = &c->plan_uses[u];
        if (use->resource == NONE || first != u) {
            continue;
        }
        chain *const chain = &c->chains[use->resource];
        if (!use->previous && c->plan->resources[use->resource].first == position) {
            state_inherit_slot(c, chain);
        }
        const access_sum sum = object_uses_sum(c, pass, u);
        if (state_advance(use->previous ? &chain->previous : &chain->state, &sum, end)) {
            end->resource = use->resource;
            end->previous = use->previous;
            if (use->previous && !chain->previous_barrier) {
                chain->previous_barrier = end;
            }
            end++;
        }
    }
    c->plan->order[position].barriers = barriers;
    c->plan->order[position].barrier_count = (uint32_t)(end - barriers);
}

// Leaves the resource as its export or import asks for, and has next frame's first read of its contents wait for that.
static void resource_finish(compiler *c, uint32_t r, frame_graph_barrier *barriers)
{
    frame_graph_plan_resource *const resource = &c->plan->resources[r];
    chain *const chain = &c->chains[r];
    const frame_graph_access after = c->versions[chain->root].after;
    access_sum sum = {0};
    access_sum_add(&sum, resource->desc.kind, after, ANY_SHADER);
    frame_graph_barrier *const final = &barriers[c->plan->final_barrier_count];
    if (after != ACCESS_NONE && state_advance(&chain->state, &sum, final)) {
        final->resource = r;
        c->plan->final_barrier_count++;
    }
    resource->final = state_final(&chain->state);
    frame_graph_barrier *const previous = chain->previous_barrier;
    if (previous) {
        previous->source_stages = resource->final.stages;
        previous->source_mask = resource->final.mask;
        previous->old_layout = resource->final.layout;
    }
}

static void barriers_place(compiler *c)
{
    states_init(c);
    for (uint32_t i = 0; i < c->order_count; i++) {
        pass_barriers_place(c, i);
    }
    frame_graph_barrier *const barriers = many(c, c->plan->resource_count, sizeof(*barriers));
    for (uint32_t r = 0; r < c->plan->resource_count; r++) {
        resource_finish(c, r, barriers);
    }
    c->plan->final_barriers = barriers;
}

// ---- Compile

// All that can be wrong is found before the first line of the plan is written, and whether a pass is needed or not: a
// cycle too, as all passes are still live when they are first ordered.
static bool input_check(compiler *c)
{
    declarations_sort(c);
    if (!declarations_check(c) || !imports_check(c)) {
        return false;
    }
    versions_collect(c);
    versions_settle(c);
    if (!makers_check(c) || !uses_resolve(c)) {
        return false;
    }
    edges_build(c);
    return order_find(c) && chains_find(c) && uses_fit_check(c) && exports_resolve(c);
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
    edges_sort_deepest_first(&c);
    order_find(&c);
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
