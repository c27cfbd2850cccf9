// Deforming meshes on the GPU: the pass "deform" writes what joints and morph targets make of their vertices into the
// scene's positions and attributes, in the frames in which they change (world_deformation in world.h). All that follows
// reads these as of any mesh.
//
//   positions, attributes, previous_positions   buffers of the scene set, in frames with the pass alone        deform
#pragma once

#include "renderer.h"

// For passes whose shaders read positions, attributes or previous_positions from the scene set: they come after
// "deform", where this frame has it. To be declared behind the pass's own bindings.
void deform_read(frame_graph_pass *pass);

// The positions at rest of the vertices of all deformations, by world_deformation.first_kept: the first member of each
// deform_vertex. For builds of acceleration structures.
gpu_buffer deform_rest(const renderer *r);
