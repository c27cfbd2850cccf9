// GLSL to SPIR-V through glslang's C interface, and the shader's interface read back through spirv-cross's.
#include "shader.h"

#include <glslang/Include/glslang_c_interface.h>
#include <glslang/Public/resource_limits_c.h>
#include <spirv_cross_c.h>

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- Includes
//
// glslang 12's C interface takes neither include callbacks nor file names, so the includes are expanded here, with
// #line directives that make its messages name file and line.

typedef struct source_text {
    char *text;
    size_t length, capacity;
    arena arena; // of the paths below
    const char **once; // files with #pragma once that have been included
    size_t once_count, once_capacity;
} source_text;

enum { INCLUDE_DEPTH_MAX = 32 };

static void source_append(source_text *source, const char *text, size_t length)
{
    memory_reserve((void **)&source->text, &source->capacity, source->length + length + 1, 1);
    memcpy(source->text + source->length, text, length);
    source->length += length;
    source->text[source->length] = '\0';
}

static void source_append_text(source_text *source, const char *text)
{
    source_append(source, text, strlen(text));
}

static void source_append_line_number(source_text *source, unsigned line, const char *path)
{
    source_append_text(source, arena_printf(&source->arena, "#line %u \"%s\"\n", line, path));
}

// If the line is the directive `name`, returns what follows it on the line.
static const char *directive_argument(const char *line, const char *name)
{
    line += strspn(line, " \t");
    if (*line++ != '#')
        return NULL;
    line += strspn(line, " \t");
    const size_t length = strlen(name);
    if (strncmp(line, name, length) != 0)
        return NULL;
    line += length;
    return line + strspn(line, " \t");
}

// Returns the path of the quoted file, beside `includer`; NULL when the line includes nothing in quotes.
static const char *include_path(source_text *source, const char *line, const char *includer)
{
    const char *argument = directive_argument(line, "include");
    if (!argument || *argument != '"')
        return NULL;
    const int length = (int)strcspn(argument + 1, "\"\n");
    const char *slash = strrchr(includer, '/');
    const int folder_length = slash ? (int)(slash - includer) + 1 : 0;
    return arena_printf(&source->arena, "%.*s%.*s", folder_length, includer, length, argument + 1);
}

static bool source_included_once(const source_text *source, const char *path)
{
    for (size_t i = 0; i < source->once_count; i++)
        if (strcmp(source->once[i], path) == 0)
            return true;
    return false;
}

static void source_mark_once(source_text *source, const char *path)
{
    memory_reserve((void **)&source->once, &source->once_capacity, source->once_count + 1, sizeof *source->once);
    source->once[source->once_count++] = path;
}

static bool source_append_file(source_text *source, const char *path, unsigned depth);

static bool source_include(source_text *source, const char *path, unsigned depth)
{
    if (source_included_once(source, path)) {
        source_append_text(source, "\n");
        return true;
    }
    // The line may be in a branch that GLSL never takes: an error only where it is reached.
    if (access(path, R_OK) != 0) {
        source_append_text(source, arena_printf(&source->arena, "#error missing include file \"%s\"\n", path));
        return true;
    }
    return source_append_file(source, path, depth + 1);
}

static bool source_append_file(source_text *source, const char *path, unsigned depth)
{
    if (depth > INCLUDE_DEPTH_MAX) {
        log_error("%s: includes itself", path);
        return false;
    }
    size_t size;
    char *text = (char *)file_read(path, &size);
    if (!text)
        return false;
    // Nothing but comments may precede #version; there the #line directive follows.
    if (depth)
        source_append_line_number(source, 1, path);
    bool done = true;
    unsigned number = 1;
    for (const char *line = text; done && *line; number++) {
        const size_t length = strcspn(line, "\n");
        const char *include = include_path(source, line, path);
        const char *pragma = directive_argument(line, "pragma");
        if (include) {
            done = source_include(source, include, depth);
            source_append_line_number(source, number + 1, path);
        } else if (pragma && strncmp(pragma, "once", 4) == 0) {
            source_mark_once(source, path);
            source_append_text(source, "\n");
        } else {
            source_append(source, line, length);
            source_append_text(source, "\n");
            if (directive_argument(line, "version")) {
                source_append_text(source, "#extension GL_GOOGLE_cpp_style_line_directive : require\n");
                source_append_line_number(source, number + 1, path);
            }
        }
        line += length + (line[length] == '\n');
    }
    free(text);
    return done;
}

static void source_fini(source_text *source)
{
    free(source->text);
    free(source->once);
    arena_fini(&source->arena);
}

// ---- Compilation

static const struct {
    const char *suffix;
    glslang_stage_t stage;
} stages[] = {
    {".comp.glsl", GLSLANG_STAGE_COMPUTE},  {".vert.glsl", GLSLANG_STAGE_VERTEX},
    {".frag.glsl", GLSLANG_STAGE_FRAGMENT}, {".rgen.glsl", GLSLANG_STAGE_RAYGEN},
    {".rmiss.glsl", GLSLANG_STAGE_MISS},    {".rchit.glsl", GLSLANG_STAGE_CLOSESTHIT},
    {".rahit.glsl", GLSLANG_STAGE_ANYHIT},
};

static bool stage_of(const char *path, glslang_stage_t *stage)
{
    const size_t length = strlen(path);
    for (size_t i = 0; i < countof(stages); i++) {
        const size_t suffix = strlen(stages[i].suffix);
        if (length > suffix && strcmp(path + length - suffix, stages[i].suffix) == 0) {
            *stage = stages[i].stage;
            return true;
        }
    }
    log_error(
        "%s: the name of a shader ends in .comp.glsl, .vert.glsl, .frag.glsl, .rgen.glsl, .rmiss.glsl, .rchit.glsl "
        "or .rahit.glsl",
        path);
    return false;
}

// Logs each of glslang's messages as "file:line: message".
static void messages_log(const char *path, const char *messages)
{
    static const char error[] = "ERROR: ", warning[] = "WARNING: ";
    while (*messages) {
        const char *line = messages;
        const char *end = line + strcspn(line, "\n");
        messages = *end ? end + 1 : end;
        const bool is_warning = strncmp(line, warning, strlen(warning)) == 0;
        if (!is_warning && strncmp(line, error, strlen(error)) != 0)
            continue;
        line += strlen(is_warning ? warning : error);
        // The closing count of errors says nothing new.
        if (end - line > 0 && memmem(line, (size_t)(end - line), "No code generated", 17))
            continue;
        while (end > line && end[-1] == ' ')
            end--;
        const log_level level = is_warning ? LOG_WARNING : LOG_ERROR;
        // Before the first #line, string 0 stands for the shader's own file.
        if (strncmp(line, "0:", 2) == 0)
            log_write(level, "%s%.*s", path, (int)(end - line) - 1, line + 1);
        else if (strncmp(line, "Linking", strlen("Linking")) == 0)
            log_write(level, "%s: %.*s", path, (int)(end - line), line);
        else
            log_write(level, "%.*s", (int)(end - line), line);
    }
}

// Compiles and links. Returns memory_alloc'd words, or NULL after logging why.
static uint32_t *compile(const char *path, const char *source, glslang_stage_t stage, size_t *word_count)
{
    const glslang_input_t input = {
        .language = GLSLANG_SOURCE_GLSL,
        .stage = stage,
        .client = GLSLANG_CLIENT_VULKAN,
        .client_version = GLSLANG_TARGET_VULKAN_1_3,
        .target_language = GLSLANG_TARGET_SPV,
        .target_language_version = GLSLANG_TARGET_SPV_1_6,
        .code = source,
        .default_version = 460,
        .default_profile = GLSLANG_NO_PROFILE,
        .messages = GLSLANG_MSG_SPV_RULES_BIT | GLSLANG_MSG_VULKAN_RULES_BIT,
        .resource = glslang_default_resource(),
    };
    uint32_t *words = NULL;
    glslang_program_t *program = glslang_program_create();
    glslang_shader_t *shader = glslang_shader_create(&input);
    if (!glslang_shader_preprocess(shader, &input) || !glslang_shader_parse(shader, &input)) {
        messages_log(path, glslang_shader_get_info_log(shader));
        goto done;
    }
    messages_log(path, glslang_shader_get_info_log(shader));
    glslang_program_add_shader(program, shader);
    if (!glslang_program_link(program, input.messages)) {
        messages_log(path, glslang_program_get_info_log(program));
        goto done;
    }
    glslang_spv_options_t options = {.disable_optimizer = true};
    glslang_program_SPIRV_generate_with_options(program, stage, &options);
    *word_count = glslang_program_SPIRV_get_size(program);
    words = memory_alloc(*word_count * sizeof *words);
    glslang_program_SPIRV_get(program, words);
done:
    glslang_shader_delete(shader);
    glslang_program_delete(program);
    return words;
}

// ---- Reflection

static const struct {
    spvc_resource_type resource;
    VkDescriptorType descriptor;
} resource_types[] = {
    {SPVC_RESOURCE_TYPE_UNIFORM_BUFFER, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER},
    {SPVC_RESOURCE_TYPE_STORAGE_BUFFER, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER},
    {SPVC_RESOURCE_TYPE_STORAGE_IMAGE, VK_DESCRIPTOR_TYPE_STORAGE_IMAGE},
    {SPVC_RESOURCE_TYPE_SAMPLED_IMAGE, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER},
    {SPVC_RESOURCE_TYPE_ACCELERATION_STRUCTURE, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR},
};

static bool binding_add(gpu_shader *shader, unsigned set, unsigned binding, VkDescriptorType type, const char *name)
{
    if (set == 1) {
        shader->uses_scene = true;
        return true;
    }
    if (set != 0 || binding >= GPU_BINDINGS_MAX) {
        log_error("%s: %s is at set %u, binding %u; there are set 0 with bindings below %d, and the scene's set 1",
                  shader->name, name, set, binding, GPU_BINDINGS_MAX);
        return false;
    }
    if ((shader->binding_mask >> binding & 1) && shader->binding_types[binding] != type) {
        log_error("%s: binding %u, %s, is declared twice with different types", shader->name, binding, name);
        return false;
    }
    shader->binding_mask |= 1u << binding;
    shader->binding_types[binding] = type;
    return true;
}

static bool bindings_reflect(spvc_compiler compiler, spvc_resources resources, gpu_shader *shader)
{
    for (size_t i = 0; i < countof(resource_types); i++) {
        const spvc_reflected_resource *list;
        size_t count;
        if (spvc_resources_get_resource_list_for_type(resources, resource_types[i].resource, &list, &count))
            return false;
        for (size_t j = 0; j < count; j++) {
            const unsigned set = spvc_compiler_get_decoration(compiler, list[j].id, SpvDecorationDescriptorSet);
            const unsigned binding = spvc_compiler_get_decoration(compiler, list[j].id, SpvDecorationBinding);
            if (!binding_add(shader, set, binding, resource_types[i].descriptor, list[j].name))
                return false;
        }
    }
    return true;
}

static bool push_size_reflect(spvc_compiler compiler, spvc_resources resources, gpu_shader *shader)
{
    const spvc_reflected_resource *list;
    size_t count, size = 0;
    if (spvc_resources_get_resource_list_for_type(resources, SPVC_RESOURCE_TYPE_PUSH_CONSTANT, &list, &count))
        return false;
    if (count) {
        const spvc_type type = spvc_compiler_get_type_handle(compiler, list[0].base_type_id);
        if (spvc_compiler_get_declared_struct_size(compiler, type, &size))
            return false;
    }
    if (size > GPU_PUSH_MAX) {
        log_error("%s: %zu bytes of push constants, of %d that every device has", shader->name, size, GPU_PUSH_MAX);
        return false;
    }
    shader->push_size = (uint32_t)size;
    return true;
}

static void on_spirv_cross_error(void *user, const char *message)
{
    const gpu_shader *shader = user;
    log_error("%s: spirv-cross: %s", shader->name, message);
}

// Only what the entry point uses counts: shared headers declare more than each shader needs.
static bool reflect(gpu_shader *shader)
{
    spvc_context context;
    if (spvc_context_create(&context) != SPVC_SUCCESS)
        return false;
    spvc_context_set_error_callback(context, on_spirv_cross_error, shader);
    spvc_parsed_ir ir;
    spvc_compiler compiler;
    spvc_set active;
    spvc_resources resources;
    const bool done =
        spvc_context_parse_spirv(context, shader->words, shader->word_count, &ir) == SPVC_SUCCESS &&
        spvc_context_create_compiler(context, SPVC_BACKEND_NONE, ir, SPVC_CAPTURE_MODE_TAKE_OWNERSHIP, &compiler) ==
            SPVC_SUCCESS &&
        spvc_compiler_get_active_interface_variables(compiler, &active) == SPVC_SUCCESS &&
        spvc_compiler_create_shader_resources_for_active_variables(compiler, &resources, active) == SPVC_SUCCESS &&
        bindings_reflect(compiler, resources, shader) && push_size_reflect(compiler, resources, shader);
    spvc_context_destroy(context);
    return done;
}

// "shaders/lgh_build.bounds.comp.glsl" is named "lgh_build.bounds.comp".
static char *shader_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    char *name = strdup(slash ? slash + 1 : path);
    name[strlen(name) - strlen(".glsl")] = '\0';
    return name;
}

bool shader_compile(const char *path, gpu_shader *shader)
{
    *shader = (gpu_shader){0};
    glslang_stage_t stage;
    if (!stage_of(path, &stage))
        return false;
    source_text source = {0};
    if (source_append_file(&source, path, 0)) {
        glslang_initialize_process();
        shader->words = compile(path, source.text, stage, &shader->word_count);
        glslang_finalize_process();
    }
    source_fini(&source);
    if (!shader->words)
        return false;
    shader->name = shader_name(path);
    if (reflect(shader))
        return true;
    shader_fini(shader);
    return false;
}

void shader_fini(gpu_shader *shader)
{
    free((void *)shader->name);
    free((void *)shader->words);
    *shader = (gpu_shader){0};
}
