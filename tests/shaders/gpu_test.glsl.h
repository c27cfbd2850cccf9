// Included by test shaders, twice by some: the second time must be empty.
#pragma once
#extension GL_EXT_scalar_block_layout : require

uint scale(uint value, uint factor) { return value * factor; }
