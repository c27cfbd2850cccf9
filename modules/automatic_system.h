// Automatic settings in the renderer: before each frame the controller (automatic.h) sees what the last one took and
// what its probes found, and may change renderer.settings. Each change is logged in one line.
#pragma once

#include "automatic.h"
#include "renderer.h"

// NULL where settings.target_ms and target_error are 0. A change of these, of the size or of a setting that is chosen
// here starts anew.
const automatic *automatic_get(const renderer *r);
