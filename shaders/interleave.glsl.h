// Interleaved sampling's tiled layout (Segovia et al. 2006): the pixels (x, y) of one residue (x mod n, y mod n) lie
// together, so that neighbouring invocations walk the same lights. n is a power of two; 1 is the identity.
#ifndef INTERLEAVE_GLSL_H
#define INTERLEAVE_GLSL_H

// Texels of one tile of an image of `size` pixels; the tiled image is n x n of these.
uvec2 interleave_tile_size(uint n, uvec2 size) { return (size + n - 1u) / n; }

// Where a pixel's value lies in the tiled image.
uvec2 interleave_texel(uvec2 pixel, uint n, uvec2 size)
{
    return (pixel & (n - 1u)) * interleave_tile_size(n, size) + (pixel >> findMSB(n)); // no division for every pixel
}

// Whose value a texel of the tiled image is. Outside `size` for the padding of a size that n does not divide.
uvec2 interleave_pixel(uvec2 texel, uint n, uvec2 size)
{
    uvec2 tile_size = interleave_tile_size(n, size);
    uvec2 tile = texel / tile_size;
    return (texel - tile * tile_size) * n + tile;
}

#endif
