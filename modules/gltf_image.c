// Images of a glTF file to RGBA8, several at once: decoding is most of the time that loading a textured scene takes.
#include "gltf.h"

#include <pthread.h>
#include <stb/stb_image.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { IMAGE_SIZE_MAX = 16384, IMAGE_TEXELS_MAX = 1 << 27, THREADS_MAX = 16 };

#define ALL_TEXELS_MAX (1ll << 30) // of a file: 4 GiB

typedef struct image_job {
    gltf_bytes encoded;
    uint8_t *owned; // NULL: the bytes lie in a buffer
    scene_image *image;
    const char *error; // static text; NULL: decoded
} image_job;

typedef struct image_queue {
    image_job *jobs;
    uint32_t count;
    atomic_uint next;
} image_queue;

// stb_image knows more formats, with more bugs, than glTF has.
static bool is_png_or_jpeg(gltf_bytes bytes)
{
    static const uint8_t png[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, jpeg[] = {0xff, 0xd8, 0xff};
    return (bytes.size >= sizeof(png) && memcmp(bytes.data, png, sizeof(png)) == 0) ||
           (bytes.size >= sizeof(jpeg) && memcmp(bytes.data, jpeg, sizeof(jpeg)) == 0);
}

static const char *image_decode(gltf_bytes bytes, scene_image *image)
{
    if (!is_png_or_jpeg(bytes) || bytes.size > INT32_MAX) {
        return "neither PNG nor JPEG";
    }
    int width = 0, height = 0, channels = 0;
    if (!stbi_info_from_memory(bytes.data, (int)bytes.size, &width, &height, &channels)) {
        return "broken header";
    }
    // The header may claim any size: memory is asked for only after this.
    if (width < 1 || height < 1 || width > IMAGE_SIZE_MAX || height > IMAGE_SIZE_MAX ||
        (int64_t)width * height > IMAGE_TEXELS_MAX) {
        return "too large, expected at most 16384 a side and 2^27 texels";
    }
    // Four channels are asked for; 16-bit files are reduced to their upper eight bits.
    image->texels = stbi_load_from_memory(bytes.data, (int)bytes.size, &width, &height, &channels, 4);
    image->width = (uint32_t)width;
    image->height = (uint32_t)height;
    return image->texels ? NULL : "broken or truncated";
}

// What the headers claim, of images that can be decoded: small files may not ask for all memory.
static int64_t texels_claimed(const image_queue *queue)
{
    int64_t sum = 0;
    for (uint32_t i = 0; i < queue->count; i++) {
        const gltf_bytes bytes = queue->jobs[i].encoded;
        int width = 0, height = 0, channels;
        if (is_png_or_jpeg(bytes) && bytes.size <= INT32_MAX &&
            stbi_info_from_memory(bytes.data, (int)bytes.size, &width, &height, &channels) && width <= IMAGE_SIZE_MAX &&
            height <= IMAGE_SIZE_MAX) {
            sum += (int64_t)width * height;
        }
    }
    return sum;
}

static void *queue_work(void *argument)
{
    image_queue *const queue = argument;
    for (uint32_t i; (i = atomic_fetch_add(&queue->next, 1)) < queue->count;) {
        image_job *const job = &queue->jobs[i];
        job->error = image_decode(job->encoded, job->image);
        free(job->owned);
        job->owned = NULL;
    }
    return NULL;
}

static void queue_run(image_queue *queue)
{
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    const uint32_t wanted = min_u32(cores > 1 ? (uint32_t)cores : 1, queue->count);
    pthread_t threads[THREADS_MAX];
    uint32_t started = 0;
    // This thread is one of the workers; a thread that cannot be had is done without.
    while (started + 1 < wanted && started < THREADS_MAX &&
           pthread_create(&threads[started], NULL, queue_work, queue) == 0) {
        started++;
    }
    queue_work(queue);
    for (uint32_t i = 0; i < started; i++) {
        pthread_join(threads[i], NULL);
    }
}

bool gltf_images_decode(const gltf_file *file, const gltf_image_source *const *sources, const gltf_bytes *encoded,
                        uint32_t count, scene_image *images)
{
    image_queue queue = {.jobs = memory_alloc(count * sizeof(image_job)), .count = count};
    bool ok = true;
    for (uint32_t i = 0; i < count && ok; i++) {
        image_job *const job = &queue.jobs[i];
        *job = (image_job){.encoded = encoded[i], .image = &images[i]};
        if (sources[i]->uri) {
            job->owned = gltf_uri_read(file, sources[i]->label, sources[i]->uri, &job->encoded.size);
            job->encoded.data = job->owned;
            ok = job->owned != NULL;
        }
    }
    const int64_t texels = ok ? texels_claimed(&queue) : 0;
    if (texels > ALL_TEXELS_MAX) {
        ok = gltf_fail(file, "images: expected at most 2^30 texels in all, got %lld", (long long)texels);
    }
    if (ok) {
        queue_run(&queue);
    }
    for (uint32_t i = 0; i < count; i++) {
        if (ok && queue.jobs[i].error) {
            ok = gltf_fail(file, "%s cannot be decoded: %s", sources[i]->label, queue.jobs[i].error);
        }
        free(queue.jobs[i].owned);
    }
    free(queue.jobs);
    return ok;
}
