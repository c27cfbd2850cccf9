// The references made of VPLs, `vpl` and `ir`: what other modules need to know of them.
#pragma once

#include "renderer.h"

// `vpl` keeps the VPLs of its first frame: it imports "vpls", and nobody need trace them.
bool vpl_reference_has_vpls(renderer *r);
