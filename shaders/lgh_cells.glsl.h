// The VPLs of a cell of S1, from the sorted list. The includer declares header, cell_masks, cell_ranks and cell_starts.
#ifndef LGH_CELLS_GLSL_H
#define LGH_CELLS_GLSL_H

// Range in the sorted order: first, and one past the last. Cells outside the grid are empty.
uvec2 cell_range(ivec3 cell)
{
    int cells = int(grid_cells(header.level_count - 1u));
    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, ivec3(cells))))
        return uvec2(0u);
    uint code = morton(uvec3(cell));
    uint bits = cell_masks[code >> 5], bit = code & 31u;
    if ((bits >> bit & 1u) == 0u)
        return uvec2(0u);
    uint rank = cell_ranks[code >> 5] + uint(bitCount(bits & ((1u << bit) - 1u)));
    return uvec2(cell_starts[rank], cell_starts[rank + 1u]);
}

#endif
