// False colours: straight lines in sRGB between given colours.
#include "image_measure.h"

#include <math.h>

static void interpolate(const uint8_t (*colors)[3], uint32_t count, float value, uint8_t rgb[3])
{
    const float at = value > 0 ? fminf(value, 1) * (float)(count - 1) : 0; // NAN: the first colour
    const uint32_t i = min_u32((uint32_t)at, count - 2);
    for (int c = 0; c < 3; c++) {
        const float low = colors[i][c], high = colors[i + 1][c];
        rgb[c] = (uint8_t)(low + (high - low) * (at - (float)i) + 0.5f);
    }
}

void color_map_sequential(float value, uint8_t rgb[3])
{
    // "magma", every tenth.
    static const uint8_t colors[][3] = {{0, 0, 4},       {20, 14, 54},    {59, 15, 112},  {100, 26, 128},
                                        {140, 41, 129},  {183, 55, 121},  {222, 73, 104}, {247, 112, 92},
                                        {254, 159, 109}, {254, 207, 146}, {252, 253, 191}};
    interpolate(colors, countof(colors), value, rgb);
}

void color_map_diverging(float value, uint8_t rgb[3])
{
    static const uint8_t colors[][3] = {
        {30, 60, 160}, {115, 155, 220}, {245, 245, 245}, {230, 140, 110}, {165, 20, 40}};
    interpolate(colors, countof(colors), value, rgb);
}
