// Where a shadow ray ends: the light's centre, a point jittered by its deviation, or one of the VPLs that it stands for.
// The includer declares the hierarchy's buffers.
#ifndef SHADOW_END_POINT_GLSL_H
#define SHADOW_END_POINT_GLSL_H

// A box with the lights' variance: of the symmetric kernels the one with the smallest support, so the fewest points land
// behind walls.
vec3 jittered(grid_light light, uint random)
{
    vec3 x = vec3(unit_float(hash(random, 1u)), unit_float(hash(random, 2u)), unit_float(hash(random, 3u)));
    return light.position + light.deviation * (sqrt(3.0) * (2.0 * x - 1.0));
}

#ifdef END_POINT_VPL

// What the light's end point sends in the whole light's place, without blending; `end` becomes the end point and `slot`
// the VPL there, or LGH_NO_SAMPLE.
vec3 end_point_light(grid_light light, uint index, uint c, vec3 centre_light, gbuffer_point p, uint random,
                     out vec3 end, out uint slot)
{
    end = light.position;
    slot = index; // of a VPL in the end; on the way, the place of a grid light
    for (; c < header.level_count && slot != LGH_NO_SAMPLE; c++) {
        random = hash(random);
        slot = samples[slot][random & 3u];
    }
    if (slot == LGH_NO_SAMPLE)
        return centre_light;
    end = vpls[slot].position;
    // A light of its own has no singularity, but what it stands for here is farther away: b keeps the sample's weight
    // from it where it happens to be near.
    float nearest = surface_share(vpls[slot]) == 0.0 ? push.singularity * push.singularity : 0.0;
    vec3 sent = vpl_light_from(vpls[slot], nearest, p, push.singularity);
    return sent * (light.intensity / vpls[slot].intensity);
}

#else

vec3 end_point_light(grid_light light, uint index, uint c, vec3 centre_light, gbuffer_point p, uint random,
                     out vec3 end, out uint slot)
{
    end = light.position;
    slot = LGH_NO_SAMPLE;
    if (!JITTER)
        return centre_light;
    end = jittered(light, random);
    return grid_light_sent(light, end, push.emission, p, push.singularity);
}

#endif
#endif
