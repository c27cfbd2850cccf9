// A night market street under thousands of lanterns.
#pragma once

#include "tools/make_scenes_gltf.h"

void lanterns_build(gltf_file *file); // 5,000 lanterns alight
void lanterns_500_build(gltf_file *file); // the same, but of ten lanterns one is alight, ten times as bright

// ---- Shared by the lanterns, the street and its people.

// Half the street's width, from its middle to the houses, and half its length; it runs along Z.
static const float street_half_width = 4.5f, street_half_length = 30;

// Adds a mesh made of one geometry and releases the triangles.
gltf_mesh lanterns_mesh_add(gltf_file *file, const char *name, mesh *mesh, gltf_material material);
// Cobbles, houses and gates (make_scenes_street.c).
void street_add(gltf_file *file);
// Stalls at both sides of the street. A stall stands on `stall_place`, its front towards +Z before it is turned by yaw.
enum { STALLS = 24 };
typedef struct stall_place {
    vec3 position;
    float yaw;
} stall_place;
stall_place stall_place_of(int stall);
void stalls_add(gltf_file *file);
// People in robes and straw hats, their limbs nodes that `clip` moves (make_scenes_people.c).
void people_add(gltf_file *file, gltf_clip clip);
