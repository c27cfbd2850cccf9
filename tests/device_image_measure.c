// The tone-mapped picture that the error measures are taken from is the one that the renderer writes.
#include "test.h"

#include "modules/image_measure.h"
#include "modules/renderer.h"

enum { WIDTH = 64, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };

static gpu *device;
static renderer *r;
static float radiance[PIXELS][4], rgb[PIXELS][3];
static uint8_t display[PIXELS][4], shown[PIXELS][3];

static void image_read(const char *name, void *texels, size_t size)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    CHECK(image.id != 0);
    CHECK(image.id && gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
}

static void frame_render(void)
{
    CHECK(renderer_frame(r));
    image_read("radiance", radiance, sizeof(radiance));
    image_read("display", display, sizeof(display));
    for (size_t i = 0; i < PIXELS; i++) {
        memcpy(rgb[i], radiance[i], sizeof(rgb[i]));
    }
}

static void pictures_check(double ev)
{
    size_t mid_tones = 0;
    image_tonemap(rgb[0], WIDTH, HEIGHT, ev, shown[0]);
    for (size_t i = 0; i < PIXELS; i++) {
        for (int c = 0; c < 3; c++) {
            CHECK(abs(shown[i][c] - display[i][c]) <= 1);
            mid_tones += shown[i][c] > 40 && shown[i][c] < 215;
        }
    }
    CHECK(mid_tones > PIXELS / 2); // neither black nor white throughout
}

TEST(the_automatic_exposure_is_the_renderer_s)
{
    r->settings.auto_exposure = true;
    frame_render();
    pictures_check(image_exposure(rgb[0], WIDTH, HEIGHT));
}

TEST(a_given_exposure_is_the_renderer_s)
{
    r->settings.auto_exposure = false;
    for (int step = -1; step <= 1; step++) {
        r->settings.exposure = (float)image_exposure(rgb[0], WIDTH, HEIGHT) + 0.75f * (float)step;
        frame_render();
        pictures_check((double)r->settings.exposure);
    }
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("no usable Vulkan device\n");
        return 77;
    }
    scene_data *const scene = scene_load(BUILD_DIR "/scenes/cornell.glb");
    render_settings settings = render_settings_default();
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.vpls = 500;
    r = scene ? renderer_create(device, scene, &settings) : NULL;
    CHECK(r != NULL);
    if (r) {
        r->camera = renderer_camera_of_scene(r, 0);
        RUN(the_automatic_exposure_is_the_renderer_s);
        RUN(a_given_exposure_is_the_renderer_s);
    }
    renderer_destroy(r);
    scene_destroy(scene);
    CHECK(gpu_validation_messages(device) == 0);
    gpu_destroy(device);
    return test_end();
}
