// Frame graph plans as text and as DOT digraphs.
#include "frame_graph_compile.h"

#include <stdio.h>
#include <stdlib.h>

const char *const FRAME_GRAPH_PASS_KINDS[] = {"graphics", "compute", "transfer", "ray tracing", "host"};
const char *const FRAME_GRAPH_RESOURCE_KINDS[] = {"buffer", "image", "acceleration structure"};
const char *const FRAME_GRAPH_USE_VERBS[] = {"creates", "reads", "modifies", "reads last frame's"};

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
    {VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR, "ray tracing"},
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

static void accesses_print(FILE *out, VkPipelineStageFlags2 stages, VkAccessFlags2 mask)
{
    bits_print(out, STAGE_NAMES, countof(STAGE_NAMES), stages);
    fputs(" (", out);
    bits_print(out, MASK_NAMES, countof(MASK_NAMES), mask);
    fputs(")", out);
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
    accesses_print(out, barrier->source_stages, barrier->source_mask);
    fputs(" -> ", out);
    accesses_print(out, barrier->destination_stages, barrier->destination_mask);
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
    fprintf(out, "       %s \"%s\"", FRAME_GRAPH_USE_VERBS[use->kind],
            use->kind == FRAME_GRAPH_USE_CREATE ? use->makes : use->name);
    if (plan_use->resource == FRAME_GRAPH_NONE) {
        fputs(": absent\n", out);
        return;
    }
    if (use->kind == FRAME_GRAPH_USE_MODIFY) {
        fprintf(out, " into \"%s\"", use->makes);
    }
    const frame_graph_access_info *const info = frame_graph_access_describe(use->access);
    fprintf(out, " as %s", info->name);
    if (info->attachment) {
        fprintf(out, ": %s, %s", load_text(plan_use->load), store_text(plan_use->store));
    }
    fputc('\n', out);
}

static void pass_print(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input, uint32_t position)
{
    const frame_graph_plan_pass *const pass = &plan->order[position];
    const frame_graph_pass_decl *const decl = &input->passes[pass->pass];
    fprintf(out, "  %3u  %s (%s)\n", position, decl->name, FRAME_GRAPH_PASS_KINDS[decl->kind]);
    for (uint32_t b = 0; b < pass->barrier_count; b++) {
        barrier_print(out, plan, &pass->barriers[b]);
    }
    for (uint32_t u = 0; u < decl->use_count; u++) {
        use_print(out, &decl->uses[u], &pass->uses[u]);
    }
}

static void resource_print(FILE *out, const frame_graph_plan_resource *resource)
{
    fprintf(out, "  \"%s\": %s", resource->name, FRAME_GRAPH_RESOURCE_KINDS[resource->desc.kind]);
    if (resource->desc.kind == FRAME_GRAPH_IMAGE) {
        fprintf(out, " %ux%u, format %d", resource->desc.width, resource->desc.height, (int)resource->desc.format);
    } else {
        fprintf(out, " of %llu bytes", (unsigned long long)resource->desc.size);
    }
    fputs(resource->import != FRAME_GRAPH_NONE ? ", import" : resource->history ? ", history" : "", out);
    if (resource->slot != FRAME_GRAPH_NONE) {
        fprintf(out, ", slot %u", resource->slot);
    }
    fputs(resource->exported ? ", exported" : "", out);
    if (resource->first == FRAME_GRAPH_NONE) {
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
        fprintf(out, "  %3u  %s%s of %llu bytes\n", s, slot->host ? "host " : "",
                FRAME_GRAPH_RESOURCE_KINDS[slot->kind], (unsigned long long)slot->requirements.size);
    }
}

static void pass_edges_print(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input, uint32_t position)
{
    const frame_graph_plan_pass *const pass = &plan->order[position];
    const frame_graph_pass_decl *const decl = &input->passes[pass->pass];
    for (uint32_t u = 0; u < decl->use_count; u++) {
        const frame_graph_plan_use *const use = &pass->uses[u];
        if (use->name) {
            fprintf(out, "  \"%s\" -> \"pass %u\"%s;\n", use->name, position,
                    use->previous ? " [style=dashed, label=\"last frame\"]" : "");
        }
        if (decl->uses[u].makes && use->resource != FRAME_GRAPH_NONE) {
            fprintf(out, "  \"pass %u\" -> \"%s\";\n", position, decl->uses[u].makes);
        }
    }
}

static void plan_print_dot(FILE *out, const frame_graph_plan *plan, const frame_graph_input *input)
{
    fputs("digraph frame {\n  rankdir=LR;\n  node [shape=ellipse];\n", out);
    for (uint32_t i = 0; i < plan->order_count; i++) {
        const frame_graph_pass_decl *const decl = &input->passes[plan->order[i].pass];
        fprintf(out, "  \"pass %u\" [shape=box, style=filled, label=\"%u %s\\n%s\"];\n", i, i, decl->name,
                FRAME_GRAPH_PASS_KINDS[decl->kind]);
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
