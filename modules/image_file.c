// PNG through stb_image_write, into memory, so that a file is written whole or not at all. OpenEXR: see tinyexr.cpp.
#include "image_file.h"

#include <stb/stb_image_write.h>

typedef struct png_file {
    const char *path;
    bool written;
} png_file;

// Called by the library once, with the whole file.
static void png_file_write(void *context, void *bytes, int size)
{
    png_file *const file = context;
    file->written = file_write(file->path, bytes, (size_t)size);
}

bool image_write_png(const char *path, const uint8_t *texels, uint32_t width, uint32_t height, uint32_t channels)
{
    assert(width > 0 && height > 0 && (channels == 3 || channels == 4));
    // The library counts bytes in int.
    if ((uint64_t)width * height * channels > INT32_MAX) {
        log_error("cannot write \"%s\": %u x %u pixels are too many for a PNG", path, width, height);
        return false;
    }
    png_file file = {.path = path};
    const int stride = (int)(width * channels);
    if (!stbi_write_png_to_func(png_file_write, &file, (int)width, (int)height, (int)channels, texels, stride)) {
        log_error("cannot write \"%s\": out of memory", path);
    }
    return file.written;
}
