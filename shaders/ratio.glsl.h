// The ratio of a shadowed to an unshadowed estimate.
#ifndef RATIO_GLSL_H
#define RATIO_GLSL_H

#include "common.glsl.h"

// Of luminances, in [0,1]; 1 where there is no light, and so nothing to shadow.
float shadow_ratio_luminance(vec3 unshadowed, vec3 shadowed)
{
    float light = luminance(unshadowed);
    return light > 0.0 ? clamp(luminance(shadowed) / light, 0.0, 1.0) : 1.0;
}

// Per channel; a channel that the samples happened to miss follows the luminance.
vec3 shadow_ratio(vec3 unshadowed, vec3 shadowed)
{
    vec3 ratio = vec3(shadow_ratio_luminance(unshadowed, shadowed));
    for (int i = 0; i < 3; i++)
        if (unshadowed[i] > 0.0)
            ratio[i] = clamp(shadowed[i] / unshadowed[i], 0.0, 1.0);
    return ratio;
}

#endif
