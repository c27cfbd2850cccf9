// Image files: PNG out, OpenEXR in and out. All writes go beside the target and are renamed.
#pragma once

#include "engine/base.h"

// Eight-bit sRGB, `channels` 3 or 4, tightly packed rows from the top.
bool image_write_png(const char *path, const uint8_t *texels, uint32_t width, uint32_t height, uint32_t channels);

// The same as the bytes of the file; free() them. NULL and one logged line on failure, with `name`.
uint8_t *image_png_encode(const char *name, const uint8_t *texels, uint32_t width, uint32_t height, uint32_t channels,
                          size_t *size);

// 32-bit float, `channels` 1 ("Y") or 3 ("R G B") interleaved, tightly packed rows from the top. ZIP compressed.
bool image_write_exr(const char *path, const float *texels, uint32_t width, uint32_t height, uint32_t channels);

// Reads any EXR with the channels R G B (or Y alone) as interleaved RGB floats; free() them. NULL and one logged line
// on failure.
float *image_read_exr(const char *path, uint32_t *width, uint32_t *height);
