// What the VPLs of this frame are to those of the last: what lets the hierarchy rebuild no more than changed.
#pragma once

#include "renderer.h"

typedef enum vpl_change {
    VPLS_ALL, // any slot may have changed: build everything
    VPLS_SOME, // `vpl_changed` exists: uint[ceil(slots / 32)], bit i of word w set where slot 32 w + i changed.
               // Slots whose bit is not set hold the same bits as in the last frame
    VPLS_NONE, // no slot changed: `vpls` holds the bits of the last frame, nothing was traced
} vpl_change;

// Of the current frame; known in the setup of every pass after vpl_trace. VPLS_ALL where there are no VPLs.
vpl_change vpl_trace_change(const renderer *r);
