// compile_shader IN.glsl OUT.spv OUT.c: compiles a shader at build time and writes it as SPIR-V, for spirv-val, and as
// a C source that defines `const gpu_shader shader_<name, dots replaced by underscores>`.
#include "engine/shader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void write_words(FILE *out, const gpu_shader *shader)
{
    fprintf(out, "static const uint32_t words[] = {");
    for (size_t i = 0; i < shader->word_count; i++)
        fprintf(out, "%s0x%08x,", i % 8 ? " " : "\n    ", shader->words[i]);
    fprintf(out, "\n};\n\n");
}

static void write_shader(FILE *out, const gpu_shader *shader)
{
    char *identifier = strdup(shader->name);
    for (char *dot = identifier; (dot = strchr(dot, '.'));)
        *dot = '_';
    fprintf(out, "const gpu_shader shader_%s = {\n", identifier);
    fprintf(out, "    .name = \"%s\",\n", shader->name);
    fprintf(out, "    .words = words,\n    .word_count = %zu,\n", shader->word_count);
    fprintf(out, "    .binding_mask = 0x%x,\n", shader->binding_mask);
    for (uint32_t i = 0; i < GPU_BINDINGS_MAX; i++)
        if (shader->binding_mask >> i & 1)
            fprintf(out, "    .binding_types[%u] = %u,\n", i, (unsigned)shader->binding_types[i]);
    fprintf(out, "    .push_size = %u,\n    .uses_scene = %u,\n};\n", shader->push_size, shader->uses_scene);
    free(identifier);
}

static bool write_c(const char *path, const gpu_shader *shader)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    fprintf(out, "// Made by tools/compile_shader.c.\n#include \"engine/gpu.h\"\n\n");
    write_words(out, shader);
    write_shader(out, shader);
    fclose(out);
    const bool written = file_write(path, text, size);
    free(text);
    return written;
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        fprintf(stderr, "usage: compile_shader IN.glsl OUT.spv OUT.c\n");
        return EXIT_FAILURE;
    }
    gpu_shader shader;
    if (!shader_compile(argv[1], &shader))
        return EXIT_FAILURE;
    const bool written =
        file_write(argv[2], shader.words, shader.word_count * sizeof *shader.words) && write_c(argv[3], &shader);
    shader_fini(&shader);
    return written ? EXIT_SUCCESS : EXIT_FAILURE;
}
