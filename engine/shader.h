// GLSL to SPIR-V for Vulkan 1.3 through glslang, with the bindings read back from the SPIR-V. Used by the build
// (tools/compile_shader.c writes each shader as a C array) and at run time for hot reload.
#pragma once

#include "gpu.h"

// Compiles `path`, whose stage is told by its name: `<module>[.<step>].<comp|vert|frag|rgen|rmiss|rchit|rahit>.glsl`. `#include "x"` is looked
// up beside the including file. Returns false and logs glslang's messages with file and line on failure; on
// success `*shader` owns memory: release it with shader_fini.
bool shader_compile(const char *path, gpu_shader *shader);
void shader_fini(gpu_shader *shader);
