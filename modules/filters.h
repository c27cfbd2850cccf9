// The filters over pixels, apart from the renderer: each adds its passes to a graph that has the inputs named here. The
// scene set must hold the frame constants. `width` and `height` are the picture's.
#pragma once

#include "renderer.h"

// ---- Interleaving: `filter_geometry`, `normals` and the tiled `indirect` to `indirect_gathered`.
typedef struct interleave {
    gpu_pipeline pipeline;
} interleave;

bool interleave_create(gpu *gpu, interleave *state); // false on failure (logged); fini is safe then too
void interleave_fini(gpu *gpu, interleave *state);
// `n` x `n` tiles, n > 1.
void interleave_declare(const interleave *state, frame_graph *graph, uint32_t width, uint32_t height, uint32_t n);

// ---- SVGF: `depth`, `normals`, `motion`, X_u and X_s to X_ratio_now; also to X_u_filtered and X_s_filtered, whose
// alpha channels hold the variances that the filter estimates to remain: of the luminance in U, of the ratio S / U in
// S.
typedef struct svgf {
    gpu_pipeline geometry, temporal, variance, atrous, atrous_ratio, atrous_last;
} svgf;

bool svgf_create(gpu *gpu, svgf *state);
void svgf_fini(gpu *gpu, svgf *state);
// Makes `filter_geometry` from `depth` and `normals`: once a frame, for all filters.
void svgf_declare_geometry(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height);
// `pair` is X; `interleave` is n where it is sampled from n x n tiles, else 1. `light_shown`: there is no analytic
// light, and the filtered U is what one sees; otherwise only the ratio counts, and U may be blurred further.
void svgf_declare(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                  uint32_t interleave, bool light_shown);

// ---- TAA: X_ratio_now, with `depth`, `normals` and `motion`, to X_ratio.
typedef struct taa {
    gpu_pipeline blend, plain;
} taa;

bool taa_create(gpu *gpu, taa *state);
void taa_fini(gpu *gpu, taa *state);
// Makes X_ratio_now from X_u and X_s where no filter does.
void taa_declare_ratio(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair);
void taa_declare(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair);
