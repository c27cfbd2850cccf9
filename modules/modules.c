// The table of contents of the renderer: its passes in frame order. The frame graph orders them by their data, so the
// order here is for the reader.
#include "modules.h"

bool modules_init(renderer *r)
{
    static bool (*const inits[])(renderer *) = {
        animation_init, // before each frame: what plays poses nodes, morph targets, lights and materials
        automatic_init, // between frames: chooses settings for a time or an error
        rays_init, // traces the batches of rays that the other passes make
        light_rays_init, // sums up the light of the shadow rays that nothing is in the way of
        subdivide_init, // levels of the subdivided meshes, by their size in the picture
        deform_init, // skins and morph targets: vertices that change
        acceleration_init, // acceleration structures that follow the deformed meshes and the instances
        vpl_trace_init, // light paths, one virtual point light a bounce
        lgh_build_init, // the lighting grid hierarchy over the VPLs
        gbuffer_init, // what each pixel sees
        direct_light_init, // punctual lights and emissive triangles
        light_gather_init, // unshadowed indirect light from the hierarchy, and the shadow samples
        light_volume_init, // the same by rasterising, as the paper does
        shadow_init, // shadows of the samples
        shadow_again_init, // some of the last frame's samples, to know where the history holds
        interleave_init, // gathers interleaved tiles
        svgf_init, // filters the shadowed and unshadowed estimates alike
        taa_init, // steadies their ratio over time
        progressive_init, // sums of the reference methods over the frames, and the picture made from them
        vpl_reference_init, // reference: every VPL at every pixel, and instant radiosity
        path_trace_init, // reference: path tracing
        composite_init, // emission + albedo * (direct + indirect * ratio)
        probe_init, // how far from all VPLs the picture is, at a few pixels
        tonemap_init, // exposure and tone curve
    };
    for (size_t i = 0; i < countof(inits); i++)
        if (!inits[i](r))
            return false;
    return true;
}
