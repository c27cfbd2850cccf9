// PNG through stb_image_write, into memory, so that a file is written whole or not at all. OpenEXR: see tinyexr.cpp.
#include "image_file.h"

#include <stb/stb_image_write.h>

#include <stdlib.h>
#include <string.h>

typedef struct png_bytes {
    uint8_t *bytes;
    size_t size;
} png_bytes;

// Called by the library once, with the whole file.
static void png_bytes_keep(void *context, void *bytes, int size)
{
    png_bytes *const png = context;
    png->size = (size_t)size;
    png->bytes = memcpy(memory_alloc(png->size), bytes, png->size);
}

uint8_t *image_png_encode(const char *name, const uint8_t *texels, uint32_t width, uint32_t height, uint32_t channels,
                          size_t *size)
{
    assert(width > 0 && height > 0 && (channels == 3 || channels == 4));
    png_bytes png = {0};
    // The library counts bytes in int.
    if ((uint64_t)width * height * channels > INT32_MAX) {
        log_error("cannot write \"%s\": %u x %u pixels are too many for a PNG", name, width, height);
        return NULL;
    }
    const int stride = (int)(width * channels);
    if (!stbi_write_png_to_func(png_bytes_keep, &png, (int)width, (int)height, (int)channels, texels, stride)) {
        log_error("cannot write \"%s\": out of memory", name);
    }
    *size = png.size;
    return png.bytes;
}

bool image_write_png(const char *path, const uint8_t *texels, uint32_t width, uint32_t height, uint32_t channels)
{
    size_t size;
    uint8_t *const bytes = image_png_encode(path, texels, width, height, channels, &size);
    const bool ok = bytes && file_write(path, bytes, size);
    free(bytes);
    return ok;
}
