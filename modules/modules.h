// The modules, one init each. modules.c calls them in frame order: the table of contents of the renderer.
#pragma once

#include "renderer.h"

bool modules_init(renderer *r); // false on failure (logged)

bool animation_init(renderer *r);
void animation_fini(renderer *r); // by renderer_destroy, as it has no pass that would; accepts a renderer without it
bool automatic_init(renderer *r);
bool rays_init(renderer *r);
bool light_rays_init(renderer *r);
bool deform_init(renderer *r);
bool acceleration_init(renderer *r);
bool vpl_trace_init(renderer *r);
bool lgh_build_init(renderer *r);
bool gbuffer_init(renderer *r);
bool direct_light_init(renderer *r);
bool light_gather_init(renderer *r);
bool light_volume_init(renderer *r);
bool shadow_init(renderer *r);
bool interleave_init(renderer *r);
bool svgf_init(renderer *r);
bool taa_init(renderer *r);
bool progressive_init(renderer *r);
bool vpl_reference_init(renderer *r);
bool path_trace_init(renderer *r);
bool composite_init(renderer *r);
bool probe_init(renderer *r);
bool tonemap_init(renderer *r);
