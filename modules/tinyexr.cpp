// OpenEXR through tinyexr, a C++ library: plain data across, exceptions caught here.
extern "C" {
#include "image_file.h"
}

#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include <tinyexr.h>

namespace
{

struct header_holder {
    EXRHeader header;
    header_holder() { InitEXRHeader(&header); }
    ~header_holder() { FreeEXRHeader(&header); }
};

struct image_holder {
    EXRImage image;
    image_holder() { InitEXRImage(&image); }
    ~image_holder() { FreeEXRImage(&image); }
};

struct free_deleter {
    void operator()(void *pointer) const { std::free(pointer); }
};

// Takes the library's message, which may be missing.
std::string message_take(const char *message)
{
    const std::string text = message ? message : "no reason given";
    FreeEXRErrorMessage(message);
    return text.substr(0, text.find('\n'));
}

// One array for each channel, in the order of `order`, which gives each the component it takes.
std::vector<std::vector<float>> planes_of(const float *texels, size_t pixels, const std::vector<size_t> &order)
{
    std::vector<std::vector<float>> planes(order.size(), std::vector<float>(pixels));
    for (size_t c = 0; c < order.size(); c++)
        for (size_t i = 0; i < pixels; i++)
            planes[c][i] = texels[i * order.size() + order[c]];
    return planes;
}

bool write(const char *path, const float *texels, uint32_t width, uint32_t height, uint32_t channels)
{
    // The format wants channels in alphabetical order.
    const std::vector<const char *> names =
        channels == 1 ? std::vector<const char *>{"Y"} : std::vector<const char *>{"B", "G", "R"};
    const std::vector<size_t> order = channels == 1 ? std::vector<size_t>{0} : std::vector<size_t>{2, 1, 0};
    std::vector<std::vector<float>> planes = planes_of(texels, size_t(width) * height, order);
    std::vector<unsigned char *> pointers;
    for (auto &plane : planes)
        pointers.push_back(reinterpret_cast<unsigned char *>(plane.data()));

    EXRImage image;
    InitEXRImage(&image);
    image.num_channels = int(channels);
    image.images = pointers.data();
    image.width = int(width);
    image.height = int(height);

    std::vector<EXRChannelInfo> infos(channels); // zeroed
    std::vector<int> types(channels, TINYEXR_PIXELTYPE_FLOAT);
    for (size_t c = 0; c < channels; c++)
        std::strcpy(infos[c].name, names[c]);
    EXRHeader header;
    InitEXRHeader(&header);
    header.compression_type = TINYEXR_COMPRESSIONTYPE_ZIP;
    header.num_channels = int(channels);
    header.channels = infos.data();
    header.pixel_types = types.data();
    header.requested_pixel_types = types.data();

    const char *message = nullptr;
    unsigned char *bytes = nullptr;
    const size_t size = SaveEXRImageToMemory(&image, &header, &bytes, &message);
    const std::unique_ptr<unsigned char, free_deleter> owner(bytes);
    if (size == 0) {
        log_error("cannot write \"%s\": %s", path, message_take(message).c_str());
        return false;
    }
    return file_write(path, bytes, size);
}

int channel_find(const EXRHeader &header, const char *name)
{
    for (int c = 0; c < header.num_channels; c++)
        if (std::strcmp(header.channels[c].name, name) == 0)
            return c;
    return -1;
}

// Parses the header and says which channels are red, green and blue. False: `error` has the reason.
bool header_read(const std::vector<unsigned char> &bytes, EXRHeader *header, int rgb[3], std::string *error)
{
    EXRVersion version;
    if (ParseEXRVersionFromMemory(&version, bytes.data(), bytes.size()) != TINYEXR_SUCCESS) {
        *error = "it is not an OpenEXR file";
        return false;
    }
    if (version.multipart || version.non_image) {
        *error = "it has several parts or deep pixels";
        return false;
    }
    const char *message = nullptr;
    if (ParseEXRHeaderFromMemory(header, &version, bytes.data(), bytes.size(), &message) != TINYEXR_SUCCESS) {
        *error = message_take(message);
        return false;
    }
    static const char *const names[] = {"R", "G", "B"};
    const int luminance = channel_find(*header, "Y");
    for (int c = 0; c < 3; c++) {
        rgb[c] = channel_find(*header, names[c]);
        if (rgb[c] < 0 && header->num_channels == 1)
            rgb[c] = luminance;
        if (rgb[c] < 0) {
            *error = "it has neither the channels R, G and B nor Y alone";
            return false;
        }
        if (header->pixel_types[rgb[c]] == TINYEXR_PIXELTYPE_UINT) {
            *error = "its channels are integers";
            return false;
        }
    }
    for (int c = 0; c < header->num_channels; c++)
        if (header->pixel_types[c] == TINYEXR_PIXELTYPE_HALF)
            header->requested_pixel_types[c] = TINYEXR_PIXELTYPE_FLOAT;
    return true;
}

// Copies a block of planes, `stride` texels a row, to (x0, y0) of the interleaved `texels`; what lies outside is cut
// off.
void block_copy(unsigned char *const *planes, const int rgb[3], int block_width, int block_height, int x0, int y0,
                int width, int height, float *texels)
{
    for (int y = 0; y < block_height && y0 + y < height; y++)
        for (int x = 0; x < block_width && x0 + x < width; x++)
            for (int c = 0; c < 3; c++)
                std::memcpy(&texels[(size_t(y0 + y) * width + x0 + x) * 3 + c],
                            planes[rgb[c]] + (size_t(y) * block_width + x) * sizeof(float), sizeof(float));
}

float *pixels_copy(const EXRImage &image, const EXRHeader &header, const int rgb[3])
{
    float *texels = static_cast<float *>(memory_alloc(size_t(image.width) * image.height * 3 * sizeof(float)));
    if (!header.tiled)
        block_copy(image.images, rgb, image.width, image.height, 0, 0, image.width, image.height, texels);
    for (int t = 0; header.tiled && t < image.num_tiles; t++) {
        const EXRTile &tile = image.tiles[t];
        block_copy(tile.images, rgb, header.tile_size_x, header.tile_size_y, tile.offset_x * header.tile_size_x,
                   tile.offset_y * header.tile_size_y, image.width, image.height, texels);
    }
    return texels;
}

float *decode(const std::vector<unsigned char> &bytes, uint32_t *width, uint32_t *height, std::string *error)
{
    header_holder header;
    image_holder image;
    int rgb[3];
    if (!header_read(bytes, &header.header, rgb, error))
        return nullptr;
    const char *message = nullptr;
    image.image.num_channels = header.header.num_channels; // else a failing load forgets to free its arrays
    if (LoadEXRImageFromMemory(&image.image, &header.header, bytes.data(), bytes.size(), &message) != TINYEXR_SUCCESS) {
        InitEXRImage(&image.image); // the library has freed its arrays but not forgotten them
        *error = message_take(message);
        return nullptr;
    }
    *width = uint32_t(image.image.width);
    *height = uint32_t(image.image.height);
    return pixels_copy(image.image, header.header, rgb);
}

} // namespace

extern "C" bool image_write_exr(const char *path, const float *texels, uint32_t width, uint32_t height,
                                uint32_t channels)
{
    assert(width > 0 && height > 0 && (channels == 1 || channels == 3));
    try {
        return write(path, texels, width, height, channels);
    } catch (const std::exception &exception) {
        log_error("cannot write \"%s\": %s", path, exception.what());
        return false;
    }
}

extern "C" float *image_read_exr(const char *path, uint32_t *width, uint32_t *height)
{
    size_t size;
    const std::unique_ptr<uint8_t, free_deleter> file(file_read(path, &size));
    if (!file)
        return nullptr;
    try {
        std::string error;
        float *const texels = decode(std::vector<unsigned char>(file.get(), file.get() + size), width, height, &error);
        if (!texels)
            log_error("cannot read \"%s\": %s", path, error.c_str());
        return texels;
    } catch (const std::exception &exception) {
        log_error("cannot read \"%s\": %s", path, exception.what());
        return nullptr;
    }
}
