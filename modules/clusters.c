// Clusters of triangles: see clusters.h.
#include "clusters.h"

#include <meshoptimizer.h>

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- Bounds

static cluster cluster_make(const uint32_t *indices, uint32_t index_count, const float (*positions)[3],
                            uint32_t vertex_count)
{
    cluster c = {.bounds = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}}};
    for (uint32_t i = 0; i < index_count; i++) {
        for (int k = 0; k < 3; k++) {
            c.bounds.min[k] = fminf(c.bounds.min[k], positions[indices[i]][k]);
            c.bounds.max[k] = fmaxf(c.bounds.max[k], positions[indices[i]][k]);
        }
    }
    const struct meshopt_Bounds b =
        meshopt_computeClusterBounds(indices, index_count, &positions[0][0], vertex_count, sizeof *positions);
    memcpy(c.centre, b.center, sizeof c.centre);
    memcpy(c.axis, b.cone_axis, sizeof c.axis);
    c.radius = b.radius;
    c.cutoff = b.cone_cutoff;
    return c;
}

void clusters_make(const uint32_t *indices, uint32_t index_count, const float (*positions)[3], uint32_t vertex_count,
                   cluster *clusters)
{
    const uint32_t step = 3 * CLUSTER_TRIANGLES;
    for (uint32_t first = 0; first < index_count; first += step) {
        const uint32_t count = min_u32(step, index_count - first);
        clusters[first / step] = cluster_make(indices + first, count, positions, vertex_count);
    }
}

bool cluster_faces_away(const cluster *c, const float eye[3])
{
    // Against rounding of the bounds, the eye and what is drawn.
    const float MARGIN = 1e-3f;
    if (c->cutoff >= 1)
        return false;
    float along = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        const float d = c->centre[k] - eye[k];
        along += d * c->axis[k];
        square += d * d;
    }
    return along >= (c->cutoff + MARGIN) * sqrtf(square) + (1 + MARGIN) * c->radius;
}

// ---- Corners

// The corner of triangle `first / 3` that should be its own: one whose vertex has no number in this cluster yet.
static uint32_t own_corner(const uint32_t *indices, uint32_t first, uint32_t cluster_first, const uint32_t *used)
{
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t number = used[indices[first + k]];
        if (number == UINT32_MAX || number < cluster_first)
            return k;
    }
    return 0;
}

void corners_order(const uint32_t *indices, uint32_t index_count, uint32_t vertex_count, uint32_t *corners)
{
    uint32_t *used = memory_alloc(max_u32(vertex_count, 1) * sizeof *used); // number that a vertex got last
    memset(used, 0xff, vertex_count * sizeof *used);
    for (uint32_t first = 0; first + 2 < index_count; first += 3) {
        const uint32_t cluster_first = first - first % (3 * CLUSTER_TRIANGLES);
        const uint32_t own = own_corner(indices, first, cluster_first, used);
        used[indices[first + own]] = first + own;
        for (uint32_t i = 0; i < 3; i++) {
            const uint32_t corner = first + (own + i) % 3;
            uint32_t *number = &used[indices[corner]];
            if (*number == UINT32_MAX || *number < cluster_first)
                *number = corner;
            corners[first + i] = *number;
        }
    }
    free(used);
}
