// Key frames: steps, lines and Catmull-Rom splines over time.
#include "playback.h"

#include <math.h>
#include <string.h>

#include <cglm/cglm.h>

static const float *key_value(const playback_curve *curve, uint32_t key)
{
    return curve->values + (size_t)key * curve->width;
}

// The last key at or before `time`, by halving.
static uint32_t key_before(const playback_curve *curve, double time)
{
    uint32_t low = 0, high = curve->key_count;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (curve->times[middle] <= time) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// By finite differences over time, one-sided at the ends.
static double tangent(const playback_curve *curve, uint32_t key, uint32_t number)
{
    const uint32_t before = key > 0 ? key - 1 : key, after = key + 1 < curve->key_count ? key + 1 : key;
    return ((double)key_value(curve, after)[number] - (double)key_value(curve, before)[number]) /
           (curve->times[after] - curve->times[before]);
}

// Cubic Hermite spline between key `k` and the next, at u in [0,1].
static void spline_at(const playback_curve *curve, uint32_t k, double u, float *value)
{
    const double span = curve->times[k + 1] - curve->times[k], u2 = u * u, u3 = u2 * u;
    for (uint32_t i = 0; i < curve->width; i++) {
        const double from = (double)key_value(curve, k)[i], to = (double)key_value(curve, k + 1)[i];
        value[i] = (float)((2 * u3 - 3 * u2 + 1) * from + (u3 - 2 * u2 + u) * span * tangent(curve, k, i) +
                           (3 * u2 - 2 * u3) * to + (u3 - u2) * span * tangent(curve, k + 1, i));
    }
}

static void line_at(const playback_curve *curve, uint32_t k, double u, float *value)
{
    for (uint32_t i = 0; i < curve->width; i++) {
        const double from = (double)key_value(curve, k)[i], to = (double)key_value(curve, k + 1)[i];
        value[i] = (float)(from + u * (to - from));
    }
}

static void slerp_at(const playback_curve *curve, uint32_t k, double u, float *value)
{
    versor from, to, between; // over-aligned, so copies
    memcpy(from, key_value(curve, k), sizeof(from));
    memcpy(to, key_value(curve, k + 1), sizeof(to));
    glm_quat_slerp(from, to, (float)u, between);
    memcpy(value, between, sizeof(between));
}

static void unit_make(float *value, uint32_t width)
{
    double square = 0;
    for (uint32_t i = 0; i < width; i++) {
        square += (double)value[i] * (double)value[i];
    }
    for (uint32_t i = 0; i < width && square > 0; i++) {
        value[i] = (float)((double)value[i] / sqrt(square));
    }
}

void playback_curve_at(const playback_curve *curve, double time, float *value)
{
    assert(curve->width > 0 && curve->key_count > 0);
    const uint32_t k = key_before(curve, time);
    if (time <= curve->times[k] || k + 1 == curve->key_count || curve->interpolation == PLAYBACK_STEP) {
        memcpy(value, key_value(curve, k), curve->width * sizeof(*value));
        return;
    }
    const double u = (time - curve->times[k]) / (curve->times[k + 1] - curve->times[k]);
    if (curve->interpolation == PLAYBACK_SPLINE) {
        spline_at(curve, k, u, value);
    } else if (curve->rotation) {
        slerp_at(curve, k, u, value);
    } else {
        line_at(curve, k, u, value);
    }
    if (curve->rotation) {
        unit_make(value, curve->width);
    }
}
