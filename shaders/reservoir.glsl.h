// Keys and names of the shadow reservoirs.
#ifndef RESERVOIR_GLSL_H
#define RESERVOIR_GLSL_H

const uint RESERVOIR_VPL = 0x80000000u; // bit of a light's name: a VPL slot (S0), not a merged grid light
const uint RESERVOIR_EMPTY = 0xffffffffu;

// -log(1 - x) / f for the uniform x of 32 random bits, as bits that order like the positive number they are. The series
// keeps the small values, which win, at full precision.
uint reservoir_key(uint bits, float f)
{
    float x = (float(bits) + 0.5) * (1.0 / 4294967808.0);
    float e = x < 0.01 ? x * (1.0 + x * (0.5 + x * (1.0 / 3.0))) : -log(1.0 - x);
    return min(floatBitsToUint(e / f), 0x7f7fffffu);
}

#endif
