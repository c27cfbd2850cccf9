// Probe pixels: a few pixels a frame, spread evenly and others in each, at which every VPL is summed and its visibility
// estimated twice, independently. The product of the two differences from what the picture shows is on average the
// square of its error, however noisy each estimate is: variance alone would not see bias.
//
// Made for automatic settings, or where renderer.probes is set, and there is indirect light with shadows:
//   probes            probe[]   see shaders/shared.h; on the host             probe
//   probe_origins, probe_directions, probe_visible, probe_estimates  PROBE_RAYS a probe
#pragma once

#include "automatic.h"
#include "renderer.h"

// Of this frame. So many that their sums over all VPLs take a few per cent of a frame; more where an error is asked
// for.
uint32_t probe_count(const renderer *r);
// The probes of the frame that has just finished; empty where there were none. The pointer is valid until the next one.
const probe *probe_results(renderer *r, uint32_t *count);
// Their part in the estimate of the error.
automatic_probes probe_sums(const probe *probes, uint32_t count);
