// Clusters of neighbouring triangles, so that a draw leaves out what is outside of the view or turned away from it, and
// an order of corners by which a rasterizer shades most vertices once.
#pragma once

#include "scene.h"
#include "world.h"

enum { CLUSTER_TRIANGLES = 64 }; // at most, of one primitive, as they follow each other in its indices

typedef struct cluster {
    box bounds; // mesh space, as all here
    float centre[3], radius; // of a sphere around its corners
    // Every normal is within an angle below 90 degrees of `axis` (unit), whose sine is `cutoff`; 1: no such axis.
    float axis[3], cutoff;
} cluster;

// The clusters of triangles [0, index_count / 3): div_up(index_count / 3, CLUSTER_TRIANGLES) are written.
void clusters_make(const uint32_t *indices, uint32_t index_count, const float (*positions)[3], uint32_t vertex_count,
                   cluster *clusters);

// Whether every triangle of the cluster shows its back to `eye` (mesh space); may miss some that do.
bool cluster_faces_away(const cluster *c, const float eye[3]);

// Corner k of a triangle t is number 3 t + k, and stands for vertex indices[3 t + k]. Writes three corner numbers a
// triangle: it turned so that its first is its own, by which a vertex shader knows the triangle, and the others numbers
// that were used before for the same vertex, where the cluster has one. What depends on the vertex alone may then be
// shaded once a number: about one a triangle on regular meshes, in place of three.
void corners_order(const uint32_t *indices, uint32_t index_count, uint32_t vertex_count, uint32_t *corners);
