// Animations in the renderer: entities with an animation_clip play. Before each frame the system puts what the clips
// change to where it is at renderer.time: matrices of nodes, weights of morph targets, lights, colours of materials.
// What a clip changes follows from the time alone; what none changes any more returns to rest once and is then left to
// the embedder. Of what several clips change, the one of the highest layer has its way, of equals the one that started
// last, of these the last in the file. Nodes whose entities are gone are passed over.
#pragma once

#include "animation.h"
#include "renderer.h"

// Adds an entity with the component "animation", an animation_clip, which may be changed and removed as any component.
entity animation_play(renderer *r, const animation_clip *clip);
void animation_stop(renderer *r, entity playing); // accepts one that has been stopped

// What the system does before a frame, at once: for those who need to know before it where things are, as cameras on
// animated nodes do.
void animation_update(renderer *r);
