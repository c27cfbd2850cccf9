// Four draws out of a list of weighted items whose sum is known, in one walk over them: systematic sampling, so each draw
// picks an item in proportion to its weight, and the four spread over the list.
#ifndef LGH_BUILD_DRAW_GLSL_H
#define LGH_BUILD_DRAW_GLSL_H

struct lgh_draws {
    vec4 targets; // each draw takes the last item with a weight before which the sum is at most its target
    uvec4 chosen;
    float sum;
};

lgh_draws draws_begin(uint random, float total)
{
    float step = 0.25 * total;
    return lgh_draws((vec4(0.0, 1.0, 2.0, 3.0) + unit_float(random)) * step, uvec4(LGH_NO_SAMPLE), 0.0);
}

void draws_add(inout lgh_draws draws, uint item, float weight)
{
    if (weight <= 0.0)
        return;
    draws.chosen = mix(draws.chosen, uvec4(item), lessThanEqual(vec4(draws.sum), draws.targets));
    draws.sum += weight;
}

#endif
