// Catmull-Clark and Loop subdivision of a control cage by OpenSubdiv: refined meshes whose vertices lie on the limit
// surface, and the stencils by which these follow when the cage moves. Topology and stencils are made once, on the CPU.
//
// All levels have their vertices on one limit surface: those of level l are among those of level l + 1, so choosing
// another level moves no vertex. The surface is that of the finest level's sharp edges: a crease whose sharpness is
// larger than `max_level` stays as sharp as one of SUBDIVISION_SHARP.
#pragma once

#include "engine/base.h"
#include "shaders/shared.h"

enum { SUBDIVISION_LEVELS_MAX = 5, SUBDIVISION_SHARP = 10, SUBDIVISION_VALUES = 8 };
// At most: triangles of the finest level; entries of the stencils, 128 MiB of them; faces at a vertex, all of whose
// neighbours are in the stencils around it.
enum { SUBDIVISION_TRIANGLES_MAX = 1 << 19, SUBDIVISION_ENTRIES_MAX = 1 << 23, SUBDIVISION_VALENCE_MAX = 64 };

typedef enum subdivision_scheme {
    SUBDIVISION_CATMARK, // faces of any number of corners
    SUBDIVISION_LOOP, // triangles
} subdivision_scheme;
typedef enum subdivision_boundary {
    SUBDIVISION_EDGE, // the surface ends in a smooth curve along the cage's boundary
    SUBDIVISION_EDGE_AND_CORNER, // and passes through vertices that only one face has
} subdivision_boundary;

typedef struct subdivision_crease {
    uint32_t vertices[2]; // of an edge of the cage; others are left out by the library
    float sharpness; // 0: smooth; SUBDIVISION_SHARP and more: for ever
} subdivision_crease;

typedef struct subdivision_cage {
    subdivision_scheme scheme;
    subdivision_boundary boundary;
    uint32_t max_level; // 1 to SUBDIVISION_LEVELS_MAX
    uint32_t vertex_count;
    uint32_t face_count;
    const uint32_t *face_sizes; // [face_count] corners, at least 3
    const uint32_t *corners; // vertices, face after face, counter-clockwise
    // Face-varying values (texture coordinates, colours): smooth over edges whose two faces share theirs, sharp at
    // corners of their islands (OpenSubdiv's FVAR_LINEAR_CORNERS_PLUS1).
    const uint32_t *corner_values; // as `corners`, below value_count; two vertices share none
    const float (*values)[SUBDIVISION_VALUES];
    uint32_t value_count;
    const subdivision_crease *creases;
    uint32_t crease_count;
} subdivision_cage;

// Rows of weights on the cage's vertices, of the limit position and of two tangents there; the surface's normal is
// tangent1 x tangent2. A vertex on a sharp edge has a row for each side, alike but for the tangents.
typedef struct subdivision_stencils {
    uint32_t count;
    uint32_t *offsets; // [count + 1], into the entries
    subdivision_entry *entries;
} subdivision_stencils;

typedef struct subdivision_corner { // a vertex of a level's mesh: no two are alike
    uint32_t stencil;
    uint32_t value; // index into subdivision's values
} subdivision_corner;

typedef struct subdivision_level { // a mesh
    uint32_t vertex_count, triangle_count;
    subdivision_corner *vertices;
    uint32_t *indices; // three a triangle, counter-clockwise as the cage
    uint32_t *faces; // [triangle_count]: the face of the cage that it comes from
} subdivision_level;

typedef struct subdivision {
    subdivision_stencils stencils;
    uint32_t value_count;
    float (*values)[SUBDIVISION_VALUES]; // on the limit surface of the values
    subdivision_level levels[SUBDIVISION_LEVELS_MAX]; // [0] is level 1; max_level of them
} subdivision;

// Refines the cage; all that is in the result belongs to `arena`. False where the library or a limit refuses it, with a
// reason that completes "cannot be subdivided: " (a file's cage is checked by scene_subdivision.c before it comes
// here).
bool subdivision_refine(const subdivision_cage *cage, arena *arena, subdivision *result, char reason[256]);

// Position, first and second tangent of a stencil over the cage's positions: what shaders/subdivide.comp.glsl does.
void subdivision_evaluate(const subdivision_stencils *stencils, uint32_t stencil, const float (*positions)[3],
                          float result[3][3]);

// Triangles of a level.
uint64_t subdivision_triangles(const subdivision_cage *cage, uint32_t level);
