// Image files: floats come back exactly, equal pictures are equal bytes, and a failed write leaves nothing behind.
#include "modules/image_file.h"

#include "test.h"

#include <dirent.h>
#include <float.h>
#include <signal.h>
#include <stb/stb_image.h>
#include <sys/resource.h>
#include <unistd.h>

static char folder[64]; // of this run, empty at first
static char last_error[512];
static int error_count;

static void remember_errors(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR) {
        error_count++;
        snprintf(last_error, sizeof(last_error), "%s", line);
    }
}

static const char *in_folder(const char *name)
{
    static char path[512];
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    return path;
}

static int files_in_folder(void)
{
    int count = 0;
    DIR *const files = opendir(folder);
    for (const struct dirent *file; (file = readdir(files));) {
        count += strcmp(file->d_name, ".") != 0 && strcmp(file->d_name, "..") != 0;
    }
    closedir(files);
    return count;
}

// `count` floats of every size, all but the first few arbitrary.
static float *floats_make(size_t count)
{
    static const float special[] = {0, -0.0f, 1, 65504, 65505, 1e30f, FLT_MAX, FLT_MIN, 1e-42f, -7.25f, 1.0f / 3};
    float *const values = memory_alloc(count * sizeof(float));
    for (size_t i = 0; i < count; i++) {
        values[i] = i < countof(special) ? special[i] : ldexpf((float)(i * 2654435761u % 1000003), (int)(i % 100) - 60);
    }
    return values;
}

TEST(exr_of_three_channels_comes_back_exactly)
{
    enum { WIDTH = 53, HEIGHT = 37 }; // two blocks of 16 rows and a part
    float *const written = floats_make(WIDTH * HEIGHT * 3);
    CHECK(image_write_exr(in_folder("rgb.exr"), written, WIDTH, HEIGHT, 3));
    uint32_t width, height;
    float *const read = image_read_exr(in_folder("rgb.exr"), &width, &height);
    CHECK(read && width == WIDTH && height == HEIGHT);
    CHECK(read && memcmp(read, written, WIDTH * HEIGHT * 3 * sizeof(float)) == 0);
    free(read);
    free(written);
}

TEST(exr_of_one_channel_comes_back_as_grey)
{
    enum { WIDTH = 5, HEIGHT = 4 };
    float *const written = floats_make(WIDTH * HEIGHT);
    CHECK(image_write_exr(in_folder("y.exr"), written, WIDTH, HEIGHT, 1));
    uint32_t width, height;
    float *const read = image_read_exr(in_folder("y.exr"), &width, &height);
    CHECK(read && width == WIDTH && height == HEIGHT);
    for (size_t i = 0; read && i < WIDTH * HEIGHT * 3; i++) {
        CHECK(read[i] == written[i / 3]);
    }
    free(read);
    free(written);
}

TEST(infinities_and_nan_survive_in_exr)
{
    const float written[3] = {INFINITY, -INFINITY, NAN};
    CHECK(image_write_exr(in_folder("infinite.exr"), written, 1, 1, 3));
    uint32_t width, height;
    float *const read = image_read_exr(in_folder("infinite.exr"), &width, &height);
    CHECK(read && read[0] == INFINITY && read[1] == -INFINITY && isnan(read[2]));
    free(read);
}

TEST(channels_are_named_in_alphabetical_order)
{
    const float texel[3] = {1, 2, 3};
    CHECK(image_write_exr(in_folder("names.exr"), texel, 1, 1, 3));
    size_t size;
    uint8_t *const bytes = file_read(in_folder("names.exr"), &size);
    // In a chlist an entry is its name, a zero byte, and 16 bytes of description; it starts behind name, type and size.
    const uint8_t *const list = bytes ? memmem(bytes, size, "channels\0chlist", 16) : NULL;
    CHECK(list && list[20] == 'B' && list[38] == 'G' && list[56] == 'R' && list[74] == 0);
    free(bytes);
}

TEST(equal_pictures_are_equal_bytes)
{
    enum { WIDTH = 64, HEIGHT = 48 };
    float *const texels = floats_make(WIDTH * HEIGHT * 3);
    CHECK(image_write_exr(in_folder("one.exr"), texels, WIDTH, HEIGHT, 3));
    CHECK(image_write_exr(in_folder("two.exr"), texels, WIDTH, HEIGHT, 3));
    size_t one_size, two_size;
    uint8_t *const one = file_read(in_folder("one.exr"), &one_size);
    uint8_t *const two = file_read(in_folder("two.exr"), &two_size);
    CHECK(one && two && one_size == two_size && memcmp(one, two, one_size) == 0);
    free(two);
    free(one);
    free(texels);
}

static void png_check(uint32_t channels)
{
    enum { WIDTH = 31, HEIGHT = 17 };
    uint8_t texels[WIDTH * HEIGHT * 4];
    for (size_t i = 0; i < sizeof(texels); i++) {
        texels[i] = (uint8_t)(i * 37 + i / 100);
    }
    CHECK(image_write_png(in_folder("picture.png"), texels, WIDTH, HEIGHT, channels));
    size_t size;
    uint8_t *const bytes = file_read(in_folder("picture.png"), &size);
    CHECK(bytes && size > 8 && memcmp(bytes, "\x89PNG\r\n\x1a\n", 8) == 0);
    int width = 0, height = 0, found = 0;
    stbi_uc *const read = bytes ? stbi_load_from_memory(bytes, (int)size, &width, &height, &found, 0) : NULL;
    CHECK(read && width == WIDTH && height == HEIGHT && found == (int)channels);
    CHECK(read && memcmp(read, texels, (size_t)WIDTH * HEIGHT * channels) == 0);
    stbi_image_free(read);
    free(bytes);
}

TEST(png_with_three_and_four_channels_comes_back_exactly)
{
    png_check(3);
    png_check(4);
}

TEST(a_png_too_large_for_its_format_is_refused)
{
    const uint8_t texel[3] = {0};
    CHECK(!image_write_png(in_folder("huge.png"), texel, 50000, 50000, 3));
    CHECK(strstr(last_error, "50000 x 50000"));
    CHECK(access(in_folder("huge.png"), F_OK) != 0);
}

TEST(a_missing_folder_fails_and_names_the_file)
{
    const float texel[3] = {0};
    const uint8_t byte_texel[3] = {0};
    error_count = 0;
    CHECK(!image_write_exr(in_folder("missing/a.exr"), texel, 1, 1, 3));
    CHECK(strstr(last_error, "missing/a.exr"));
    CHECK(!image_write_png(in_folder("missing/a.png"), byte_texel, 1, 1, 3));
    CHECK(strstr(last_error, "missing/a.png"));
    CHECK(error_count == 2); // each failure is logged once
}

// A write that fails half way: files of this process may not grow past one kilobyte.
TEST(a_full_disk_leaves_the_old_file_and_nothing_else)
{
    enum { WIDTH = 64, HEIGHT = 64 };
    float *const texels = floats_make(WIDTH * HEIGHT * 3);
    const float old[3] = {1, 2, 3};
    CHECK(image_write_exr(in_folder("kept.exr"), old, 1, 1, 3));
    const int before = files_in_folder();

    struct rlimit limit;
    getrlimit(RLIMIT_FSIZE, &limit);
    const struct rlimit small = {.rlim_cur = 1024, .rlim_max = limit.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &small);
    CHECK(!image_write_exr(in_folder("kept.exr"), texels, WIDTH, HEIGHT, 3));
    CHECK(!image_write_exr(in_folder("new.exr"), texels, WIDTH, HEIGHT, 3));
    setrlimit(RLIMIT_FSIZE, &limit);

    CHECK(files_in_folder() == before);
    uint32_t width, height;
    float *const read = image_read_exr(in_folder("kept.exr"), &width, &height);
    CHECK(read && width == 1 && height == 1 && memcmp(read, old, sizeof(old)) == 0);
    free(read);
    free(texels);
}

TEST(broken_exr_files_are_refused_by_name)
{
    enum { WIDTH = 64, HEIGHT = 48 };
    float *const texels = floats_make(WIDTH * HEIGHT * 3);
    CHECK(image_write_exr(in_folder("whole.exr"), texels, WIDTH, HEIGHT, 3));
    size_t size;
    uint8_t *const bytes = file_read(in_folder("whole.exr"), &size);
    const size_t lengths[] = {0, 3, 8, 40, 200, 330, 500, size / 2, size - 1};
    for (size_t i = 0; bytes && i < countof(lengths); i++) {
        uint32_t width, height;
        CHECK(file_write(in_folder("broken.exr"), bytes, lengths[i]));
        last_error[0] = '\0';
        CHECK(!image_read_exr(in_folder("broken.exr"), &width, &height));
        CHECK(strstr(last_error, "broken.exr"));
    }
    uint32_t width, height;
    CHECK(!image_read_exr(in_folder("absent.exr"), &width, &height));
    CHECK(strstr(last_error, "absent.exr"));
    CHECK(!image_read_exr(folder, &width, &height));
    free(bytes);
    free(texels);
}

TEST(a_png_is_not_an_exr)
{
    const uint8_t texel[3] = {0};
    CHECK(image_write_png(in_folder("picture.exr"), texel, 1, 1, 3));
    uint32_t width, height;
    CHECK(!image_read_exr(in_folder("picture.exr"), &width, &height));
    CHECK(strstr(last_error, "not an OpenEXR file"));
}

static void folder_remove(void)
{
    DIR *const files = opendir(folder);
    for (const struct dirent *file; (file = readdir(files));) {
        unlink(in_folder(file->d_name));
    }
    closedir(files);
    rmdir(folder);
}

int main(void)
{
    strcpy(folder, "/tmp/test_image_file.XXXXXX");
    if (!mkdtemp(folder)) {
        perror(folder);
        return EXIT_FAILURE;
    }
    log_sink_set(remember_errors, NULL);
    RUN(exr_of_three_channels_comes_back_exactly);
    RUN(exr_of_one_channel_comes_back_as_grey);
    RUN(infinities_and_nan_survive_in_exr);
    RUN(channels_are_named_in_alphabetical_order);
    RUN(equal_pictures_are_equal_bytes);
    RUN(png_with_three_and_four_channels_comes_back_exactly);
    RUN(a_png_too_large_for_its_format_is_refused);
    RUN(a_missing_folder_fails_and_names_the_file);
    RUN(a_full_disk_leaves_the_old_file_and_nothing_else);
    RUN(broken_exr_files_are_refused_by_name);
    RUN(a_png_is_not_an_exr);
    folder_remove();
    return test_end();
}
