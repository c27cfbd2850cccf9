// How many frames the history may count around each stratum of the last frame: from what the recorded samples on the same
// surface around were and are now, their light and whether it arrives, and from how far the history lags behind them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "filter_geometry.glsl.h"
#include "shadow_again.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, scalar) readonly buffer records_block { shadow_record records[]; };
layout(set = 0, binding = 1, scalar) readonly buffer light_block { float light_now[]; }; // negative: not traced
layout(set = 0, binding = 2, scalar) readonly buffer visible_block { uint visible_now[]; };
layout(set = 0, binding = 3, rg32f) uniform writeonly image2D limit_map; // frames; the change, also that before
layout(set = 0, binding = 4) uniform sampler2D previous_limit;
layout(set = 0, binding = 5, scalar) readonly buffer lags_block { shadow_lag lags[]; };
layout(push_constant, scalar) uniform push_block {
    uint history_valid; // 1: there was a limit in the last frame too
    uint records_valid;
    uint traced;        // 1: samples were traced again
    uint has_lags;
} push;

const int RADIUS = 3; // strata
const float UNLIMITED = 1e6;
// Variance of the ratio that the filter leaves of one frame's samples, about; of a low ratio it is proportional to that.
const float VARIANCE = 0.001;
// How much the ratio changes where all the light comes from elsewhere, about, and the share of the light that may come
// from elsewhere before it counts: what drifts so slowly the history follows.
const float LIGHT_CHANGE = 1.0, LIGHT_TOLERANCE = 0.2;

const shadow_lag NO_LAG = shadow_lag(vec2(0.0), 0.0, 0.0, vec2(0.0));

shadow_record record_at(uint index)
{
    shadow_record r = records[index];
    if (push.records_valid == 0u)
        r.light = 0.0;
    return r;
}

struct sums {
    vec4 light;   // U before, S before, U now, S now
    vec3 squares; // of S: before, before times now, now
    float count;  // records
    float logarithms; // of now over before, of those that still have light
    float lit;        // how many these are; both where samples were traced again
    shadow_lag lag;
    vec3 same;        // of records of the instance whose VPL sends what it did: U, the change of S, and the squares of that
};

struct neighbour {
    bool counts; // lies on the same surface, and is known
    bool same;   // and on the same instance
    float before, now; // what the sample adds to U
    bool seen_before, seen_now;
    shadow_lag lag;
};

neighbour neighbour_at(ivec2 stratum, shadow_record center, float footprint)
{
    neighbour n = neighbour(false, false, 0.0, 0.0, false, false, NO_LAG);
    ivec2 size = ivec2(again_size());
    if (any(lessThan(stratum, ivec2(0))) || any(greaterThanEqual(stratum, size)))
        return n;
    uint index = again_index(uvec2(stratum));
    shadow_record r = record_at(index);
    if (r.light <= 0.0)
        return n;
    // What is seen at a grazing angle is far apart: records of one plane count wherever they are.
    vec3 normal = octahedral_decode(center.normals.xy);
    n.counts = dot(normal, octahedral_decode(r.normals.xy)) > 0.9 &&
               abs(dot(normal, r.position - center.position)) < footprint;
    n.same = r.identity == center.identity;
    n.before = r.weight * r.light;
    n.now = push.traced != 0u ? r.weight * abs(light_now[index]) : n.before;
    n.seen_before = r.visible != 0u;
    n.seen_now = push.traced != 0u && light_now[index] > 0.0 ? visible_now[index] != 0u : n.seen_before;
    if (push.has_lags != 0u)
        n.lag = lags[index];
    return n;
}

void add(inout sums sum, neighbour n)
{
    float seen_before = n.seen_before ? n.before : 0.0, seen_now = n.seen_now ? n.now : 0.0;
    sum.light += vec4(n.before, seen_before, n.now, seen_now);
    sum.squares += vec3(seen_before * seen_before, seen_before * seen_now, seen_now * seen_now);
    sum.count += 1.0;
    sum.lag.now += n.lag.now;
    sum.lag.light += n.lag.light;
    sum.lag.lag += n.lag.lag;
    sum.lag.squares += n.lag.squares;
    if (n.same && abs(n.now - n.before) < 0.01 * n.before) {
        float change = n.before * (float(n.seen_now) - float(n.seen_before));
        sum.same += vec3(n.before, change, change * change);
    }
    if (push.traced != 0u && n.now > 0.0) {
        sum.logarithms += clamp(log(n.now / n.before), -4.0, 4.0);
        sum.lit += 1.0;
    }
}

// By how much the ratio S / U changed, beyond what a few samples that changed by themselves may explain.
float ratio_change(sums sum)
{
    if (sum.light.x <= 0.0 || sum.light.z <= 0.0)
        return 0.0;
    vec2 scale = 1.0 / sum.light.xz;
    float change = abs(sum.light.w * scale.y - sum.light.y * scale.x);
    float square = dot(sum.squares, vec3(scale.x * scale.x, -2.0 * scale.x * scale.y, scale.y * scale.y));
    return max(change - 2.0 * sqrt(max(square, 0.0)), 0.0);
}

// The same by what stands in the way of light that stays as it is: geometry that moves, which is no noise.
float occlusion_change(sums sum)
{
    return max(abs(sum.same.y) - sqrt(sum.same.z), 0.0) / max(sum.light.x, 1e-30);
}

float variance_of(float ratio) { return VARIANCE * min(4.0 * ratio, 1.0); }

// Of a ratio that drifts by d a frame, n frames are off by n d / 2 and leave the variance V / n: the sum of the squares is
// least at n^3 = 2 V / d^2.
float frames_of(float change, float variance)
{
    return change > 1e-4 ? pow(2.0 * variance / (change * change), 1.0 / 3.0) : UNLIMITED;
}

// A history of n frames that is off by b and one frame of the variance V: the squares' sum of their mean is least at
// n = V / b^2.
float lag_frames(shadow_lag lag)
{
    if (lag.now.x <= 0.0)
        return UNLIMITED;
    const float NOISE = 3.0; // standard deviations
    float deviation = sqrt(max(lag.squares.x, lag.squares.y));
    float off = max(abs(lag.lag) - NOISE * deviation, 0.0) / lag.light;
    return off > 1e-4 ? variance_of(clamp(lag.now.y / lag.now.x, 0.0, 1.0)) / (off * off) : UNLIMITED;
}

// What changed around in the last frames, the oldest least.
float change_before(ivec2 stratum)
{
    float before = 0.0;
    for (int i = 0; i < 9 && push.history_valid != 0u; i++) {
        ivec2 tap = clamp(stratum + ivec2(i % 3, i / 3) - 1, ivec2(0), ivec2(again_size()) - 1);
        before = max(before, texelFetch(previous_limit, tap, 0).y);
    }
    return 0.9 * before;
}

struct finding {
    float light;     // change of the light
    float occlusion; // change by what stands in its way
    float ratio;     // now
    float lag;       // frames, by the lag of the history
};

// What share of the light comes from elsewhere, beyond chance. All of it brighter or dimmer alike does not change the ratio.
float light_elsewhere(sums sum, ivec2 stratum, shadow_record center, float footprint)
{
    float mean = exp(sum.logarithms / max(sum.lit, 1.0)), elsewhere = 0.0;
    for (int i = 0; i < (2 * RADIUS + 1) * (2 * RADIUS + 1); i++) {
        neighbour n = neighbour_at(stratum + ivec2(i % (2 * RADIUS + 1), i / (2 * RADIUS + 1)) - RADIUS, center, footprint);
        if (n.counts)
            elsewhere += abs(n.now - mean * n.before) / (n.now + mean * n.before);
    }
    // Of few records each may change by chance.
    float tolerance = LIGHT_TOLERANCE + 0.5 * inversesqrt(max(sum.count, 1.0));
    return max(elsewhere / max(sum.count, 1.0) - tolerance, 0.0);
}

finding finding_of(ivec2 stratum, shadow_record center)
{
    float view_z = dot(center.position - frame.previous_eye, frame.previous_forward);
    float footprint = 4.0 * float(AGAIN_SIDE) * pixel_footprint(view_z);
    sums sum = sums(vec4(0.0), vec3(0.0), 0.0, 0.0, 0.0, NO_LAG, vec3(0.0));
    for (int i = 0; i < (2 * RADIUS + 1) * (2 * RADIUS + 1); i++) {
        neighbour n = neighbour_at(stratum + ivec2(i % (2 * RADIUS + 1), i / (2 * RADIUS + 1)) - RADIUS, center, footprint);
        if (n.counts)
            add(sum, n);
    }
    float elsewhere = push.traced != 0u ? light_elsewhere(sum, stratum, center, footprint) : 0.0;
    return finding(max(ratio_change(sum), LIGHT_CHANGE * elsewhere), occlusion_change(sum),
                   clamp(sum.light.w / max(sum.light.z, 1e-30), 0.0, 1.0), lag_frames(sum.lag));
}

void main()
{
    ivec2 stratum = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(stratum, ivec2(again_size()))))
        return;
    shadow_record center = record_at(again_index(uvec2(stratum)));
    // Without a record of its own the stratum goes by one next to it.
    for (int i = 0; i < 9 && center.light <= 0.0; i++) {
        ivec2 next = clamp(stratum + ivec2(i % 3, i / 3) - 1, ivec2(0), ivec2(again_size()) - 1);
        center = record_at(again_index(uvec2(next)));
    }
    finding found = finding(0.0, 0.0, 1.0, UNLIMITED);
    if (center.light > 0.0)
        found = finding_of(stratum, center);
    // Light that changes as much in frame after frame drifts, and the history follows; what is new counts.
    float before = change_before(stratum), sudden = max(found.light - 1.5 * before, 0.0);
    float frames = min(frames_of(max(sudden, found.occlusion), variance_of(found.ratio)), found.lag);
    imageStore(limit_map, stratum, vec4(frames, max(found.light, before), 0.0, 0.0));
}
