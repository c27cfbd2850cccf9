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

// ---- Reprojection: the images of shaders/reproject.glsl.h, as the pass's next seven bindings.
void reprojection_declare(frame_graph_pass *pass);
bool reprojection_is_valid(const frame_graph_context *context); // for execute: there is a last frame

// ---- SVGF: `depth`, `normals`, `motion`, `albedo`, X_u and X_s to X_ratio_now; also to X_u_filtered and X_s_filtered,
// whose alpha channels hold the variances that the filter estimates to remain: of the luminance in U, of the ratio S /
// U in S.
typedef struct svgf {
    gpu_pipeline geometry, temporal, hold, variance, atrous, atrous_ratio, atrous_last;
} svgf;

bool svgf_create(gpu *gpu, svgf *state);
void svgf_fini(gpu *gpu, svgf *state);
// Makes `filter_geometry` from `depth` and `normals`: once a frame, for all filters.
void svgf_declare_geometry(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height);
typedef struct svgf_desc {
    uint32_t interleave; // n where the pair is sampled from n x n tiles; 0: 1
    // There is no analytic light, and the filtered U is what one sees; otherwise only the ratio counts, and U may be
    // blurred further.
    bool light_shown;
    uint32_t still_frames; // in a row that show what the last one did, this one included: the history may grow long
    bool hold; // the history stays as it is; X_u and X_s are not read
    const char *limit; // image that says how far the history holds, see shadow_again.h; NULL: none
} svgf_desc;
// `pair` is X.
void svgf_declare(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                  const svgf_desc *desc);

// ---- TAA: X_ratio_now, with `depth`, `normals`, `motion` and `albedo`, to X_ratio.
typedef struct taa {
    gpu_pipeline blend, light, plain;
} taa;
typedef struct taa_desc {
    bool hold; // the last frame's result stays as it is
    const char *limit; // as of svgf_desc
    // TAA_RATIO; TAA_LIGHT: makes X_steadied (RGBA32F, the light after shadows; a: frames) of X_ratio_now and the
    // analytic light that this names.
    const char *light;
} taa_desc;

bool taa_create(gpu *gpu, taa *state);
void taa_fini(gpu *gpu, taa *state);
// Makes X_ratio_now from X_u and X_s where no filter does.
void taa_declare_ratio(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair);
void taa_declare(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                 const taa_desc *desc);
