// Where a device has no ray query, ray-tracing pipelines trace, and every picture stays what it is by query.
#include "modules/rays.h"
#include "modules/world.h"
#include "test.h"

#include <unistd.h>

enum { WIDTH = 96, HEIGHT = 64, PIXELS = WIDTH * HEIGHT };

#define SHARED_SCENES "../shared/scenes/"
#define OWN_SCENES BUILD_DIR "/scenes/"

static gpu *query_device, *pipeline_device; // the same, the second as if it had no ray query

static char last_error[512];
static uint32_t errors;

static void error_keep(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR) {
        errors++;
        snprintf(last_error, sizeof last_error, "%s", line);
    }
}

static void errors_keep(void)
{
    errors = 0;
    log_sink_set(error_keep, NULL);
}

static renderer *renderer_of(gpu *gpu, const scene_data *scene, uint32_t method, uint32_t tracer)
{
    render_settings settings = render_settings_default();
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.vpls = 2000;
    settings.method = method;
    settings.rays = tracer;
    renderer *r = renderer_create(gpu, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    r->exports[r->export_count++] = "radiance";
    r->camera = renderer_camera_of_scene(r, scene->camera_count ? 0 : SCENE_NONE);
    return r;
}

// Two frames, so that history is used too.
static float (*picture(gpu *gpu, const scene_data *scene, uint32_t method, uint32_t tracer))[4]
{
    renderer *r = renderer_of(gpu, scene, method, tracer);
    CHECK(renderer_frame(r) && renderer_frame(r));
    CHECK(rays_tracer(r) == tracer);
    float(*texels)[4] = memory_alloc(PIXELS * sizeof *texels);
    const gpu_image image = frame_graph_find_image(r->graph, "radiance");
    CHECK(image.id &&
          gpu_image_read(gpu, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, PIXELS * sizeof *texels));
    renderer_destroy(r);
    return texels;
}

static void pictures_compare(const char *path, uint32_t method)
{
    scene_data *scene = scene_load(path);
    if (!scene) {
        printf("  skipped: no %s\n", path);
        return;
    }
    float(*by_query)[4] = picture(query_device, scene, method, RAYS_QUERY);
    float(*by_pipeline)[4] = picture(pipeline_device, scene, method, RAYS_PIPELINE);
    double square = 0, sum = 0;
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < 3; k++) {
            const double difference = (double)by_pipeline[i][k] - (double)by_query[i][k];
            square += difference * difference;
            sum += (double)by_query[i][k];
        }
    printf("  %s: rms difference %g, mean %g\n", strrchr(path, '/') + 1, sqrt(square / (3 * PIXELS)),
           sum / (3 * PIXELS));
    CHECK(sum > 0);
    CHECK(square == 0); // measured: every bit
    free(by_query);
    free(by_pipeline);
    scene_destroy(scene);
}

TEST(pictures_are_those_of_ray_query)
{
    pictures_compare(OWN_SCENES "cornell.glb", METHOD_LGH);
    pictures_compare(OWN_SCENES "two_rooms.glb", METHOD_LGH);
    if (access(SHARED_SCENES "sponza/sponza.gltf", R_OK) == 0) // with alpha masks
        pictures_compare(SHARED_SCENES "sponza/sponza.gltf", METHOD_LGH);
}

TEST(references_are_those_of_ray_query)
{
    pictures_compare(OWN_SCENES "cornell.glb", METHOD_PATH);
    pictures_compare(OWN_SCENES "cornell.glb", METHOD_VPL);
}

TEST(query_is_refused_without_it_and_auto_finds_the_pipeline)
{
    CHECK(!gpu_has_ray_query(pipeline_device) && gpu_has_ray_pipelines(pipeline_device));
    scene_data *scene = scene_load(OWN_SCENES "cornell.glb");
    renderer *r = renderer_of(pipeline_device, scene, METHOD_LGH, RAYS_QUERY);
    errors_keep();
    CHECK(!renderer_frame(r));
    log_sink_set(NULL, NULL);
    CHECK(errors == 1 && strstr(last_error, "--rays query") && strstr(last_error, gpu_name(pipeline_device)));
    r->settings.rays = RAYS_AUTO;
    CHECK(renderer_frame(r) && rays_tracer(r) == (gpu_is_cpu(pipeline_device) ? RAYS_EMBREE : RAYS_PIPELINE));
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(a_device_with_neither_is_refused_by_name)
{
    errors_keep();
    gpu *gpu = gpu_create(
        &(gpu_desc){.device = gpu_name(query_device), .without_ray_query = true, .without_ray_pipelines = true});
    log_sink_set(NULL, NULL);
    CHECK(!gpu && errors == 1);
    CHECK(strstr(last_error, gpu_name(query_device)) && strstr(last_error, VK_KHR_RAY_QUERY_EXTENSION_NAME) &&
          strstr(last_error, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME));
    gpu_destroy(gpu);
}

TEST(the_validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(query_device) == 0 && gpu_validation_messages(pipeline_device) == 0);
}

int main(void)
{
    query_device = gpu_create(&(gpu_desc){.validation = true});
    if (!query_device) {
        printf("skipped: no device with the validation layer\n");
        return 77;
    }
    if (!gpu_has_ray_query(query_device) || !gpu_has_ray_pipelines(query_device)) {
        printf("skipped: %s has not both ray queries and ray-tracing pipelines\n", gpu_name(query_device));
        gpu_destroy(query_device);
        return 77;
    }
    pipeline_device =
        gpu_create(&(gpu_desc){.device = gpu_name(query_device), .validation = true, .without_ray_query = true});
    RUN(pictures_are_those_of_ray_query);
    RUN(references_are_those_of_ray_query);
    RUN(query_is_refused_without_it_and_auto_finds_the_pipeline);
    RUN(a_device_with_neither_is_refused_by_name);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(pipeline_device);
    gpu_destroy(query_device);
    return test_end();
}
