// Which kinds of direct light this frame has; see the names in renderer.h.
#pragma once

#include "renderer.h"

// The pair `direct_u`, `direct_s` exists: there are emissive triangles, or too many punctual lights for a ray each.
bool direct_light_is_sampled(const renderer *r);
// `direct_analytic` exists beside the pair: its unshadowed light is known without noise.
bool direct_light_is_analytic(const renderer *r);
