// Orders triangles for drivers that build a BVH by halving the list as given (lavapipe): recursive splits of the list
// at exactly its half, by the surface area heuristic. A mesh's list is that of its primitives, one after the other.
#include "gltf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- Boxes

typedef struct box {
    float min[3], max[3];
} box;

static const box box_empty = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

static void box_add(box *b, const float min[3], const float max[3])
{
    for (int i = 0; i < 3; i++) {
        b->min[i] = min[i] < b->min[i] ? min[i] : b->min[i];
        b->max[i] = max[i] > b->max[i] ? max[i] : b->max[i];
    }
}

static float box_centre(const box *b, int axis)
{
    return 0.5f * b->min[axis] + 0.5f * b->max[axis];
}

static float box_half_area(const box *b) // 0 when empty
{
    const float x = b->max[0] - b->min[0], y = b->max[1] - b->min[1], z = b->max[2] - b->min[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

// ---- Sorting

typedef struct sort_item {
    uint32_t key, index;
} sort_item;

// Maps floats to integers of the same order.
static uint32_t sortable(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

// Stable; least significant digit first.
static void radix_sort(sort_item *items, sort_item *scratch, uint32_t count)
{
    enum { DIGIT_BITS = 8, DIGITS = 1 << DIGIT_BITS };
    for (uint32_t shift = 0; shift < 32; shift += DIGIT_BITS) { // an even number of passes: ends in `items`
        uint32_t offsets[DIGITS] = {0}, sum = 0;
        for (uint32_t i = 0; i < count; i++) {
            offsets[items[i].key >> shift & (DIGITS - 1)]++;
        }
        for (uint32_t d = 0; d < DIGITS; d++) {
            const uint32_t digit_count = offsets[d];
            offsets[d] = sum;
            sum += digit_count;
        }
        for (uint32_t i = 0; i < count; i++) {
            scratch[offsets[items[i].key >> shift & (DIGITS - 1)]++] = items[i];
        }
        sort_item *const swap = items;
        items = scratch;
        scratch = swap;
    }
}

// ---- The state of one sort
//
// Three orders are kept sorted along their axes all the way down, so that a split is simply a cut: no selection, no
// worst case, and ties fall to the lower triangle, so that the result is the same everywhere.
typedef struct triangle_sort {
    box *boxes; // by triangle
    uint32_t *order[3]; // triangles, sorted by the centre of their box along each axis, primitive by primitive
    uint32_t *scratch;
    uint8_t *in_second; // by triangle: side of the split under way
    uint32_t *sequence; // primitives in the order in which they come out
    uint32_t sequence_count;
    uint32_t *result; // triangles as they come out
    uint32_t result_count;
    arena memory;
} triangle_sort;

static void axis_sort(triangle_sort *sort, uint32_t begin, uint32_t count, int axis)
{
    sort_item *const items = memory_alloc(2 * (size_t)count * sizeof(sort_item));
    for (uint32_t i = 0; i < count; i++) {
        items[i] = (sort_item){sortable(box_centre(&sort->boxes[begin + i], axis)), begin + i};
    }
    radix_sort(items, items + count, count);
    for (uint32_t i = 0; i < count; i++) {
        sort->order[axis][begin + i] = items[i].index;
    }
    free(items);
}

static void sort_init(triangle_sort *sort, uint32_t triangle_count, uint32_t primitive_count)
{
    *sort = (triangle_sort){0};
    sort->boxes = arena_alloc(&sort->memory, triangle_count * sizeof(*sort->boxes));
    sort->scratch = arena_alloc(&sort->memory, triangle_count * sizeof(uint32_t));
    sort->in_second = arena_alloc(&sort->memory, triangle_count);
    sort->result = arena_alloc(&sort->memory, triangle_count * sizeof(uint32_t));
    sort->sequence = arena_alloc(&sort->memory, primitive_count * sizeof(uint32_t));
    for (int axis = 0; axis < 3; axis++) {
        sort->order[axis] = arena_alloc(&sort->memory, triangle_count * sizeof(uint32_t));
    }
}

// Adds a primitive's triangles, numbered from `begin` on.
static void sort_add(triangle_sort *sort, uint32_t begin, const uint32_t *indices, uint32_t count,
                     const float (*positions)[3])
{
    for (uint32_t i = 0; i < 3 * count; i++) {
        box *const b = &sort->boxes[begin + i / 3];
        *b = i % 3 == 0 ? box_empty : *b;
        box_add(b, positions[indices[i]], positions[indices[i]]);
    }
    for (int axis = 0; axis < 3; axis++) {
        axis_sort(sort, begin, count, axis);
    }
}

static box range_box(const triangle_sort *sort, int axis, uint32_t begin, uint32_t end)
{
    box result = box_empty;
    for (uint32_t i = begin; i < end; i++) {
        const box *const b = &sort->boxes[sort->order[axis][i]];
        box_add(&result, b->min, b->max);
    }
    return result;
}

// Brings those marked in_second behind the others, in the same order.
static void stable_partition(const triangle_sort *sort, uint32_t *order, uint32_t count)
{
    uint32_t first = 0, second = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (sort->in_second[order[i]]) {
            sort->scratch[second++] = order[i];
        } else {
            order[first++] = order[i];
        }
    }
    memcpy(order + first, sort->scratch, second * sizeof(*order));
}

// Cuts [begin, end) along an axis, in all orders: those from `cut` on become the second part; with `descending`,
// those before `cut`.
static void range_cut(const triangle_sort *sort, int axis, bool descending, uint32_t begin, uint32_t cut, uint32_t end)
{
    for (uint32_t i = begin; i < end; i++) {
        sort->in_second[sort->order[axis][i]] = (i >= cut) != descending;
    }
    for (int other = 0; other < 3; other++) {
        if (other != axis || descending) {
            stable_partition(sort, sort->order[other] + begin, end - begin);
        }
    }
}

// ---- One primitive

// Surface area heuristic where both halves hold the same number: the sum of their areas decides.
static int best_axis(const triangle_sort *sort, uint32_t begin, uint32_t middle, uint32_t end)
{
    int best = 0;
    float best_area = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        const box first = range_box(sort, axis, begin, middle), second = range_box(sort, axis, middle, end);
        const float area = box_half_area(&first) + box_half_area(&second);
        if (area < best_area) {
            best_area = area;
            best = axis;
        }
    }
    return best;
}

// Recursion is as deep as the logarithm of the count.
static void median_split(triangle_sort *sort, uint32_t begin, uint32_t end)
{
    if (end - begin == 1) {
        sort->result[sort->result_count++] = sort->order[0][begin];
        return;
    }
    const uint32_t middle = begin + (end - begin) / 2;
    range_cut(sort, best_axis(sort, begin, middle, end), false, begin, middle, end);
    median_split(sort, begin, middle);
    median_split(sort, middle, end);
}

void scene_primitive_reorder(uint32_t *indices, uint32_t index_count, const float (*positions)[3])
{
    gltf_primitive primitive = {.indices = indices, .index_count = index_count, .positions = (float(*)[3])positions};
    uint32_t sequence;
    mesh_triangles_reorder(&primitive, 1, &sequence);
}

// ---- Several primitives
//
// A primitive stays in one piece, for it has one material, so only the order of primitives is free where the half of
// the list falls between two of them; the one that lies across the half is cut there. Its parts must stay neighbours:
// the one in the first half comes last there, the one in the second half first.

typedef struct piece {
    uint32_t begin, count; // triangles order[*][begin, begin + count)
    uint32_t primitive;
    box box;
} piece;

typedef struct piece_list {
    piece *pieces;
    uint32_t count, triangles;
    bool first_fixed, last_fixed;
} piece_list;

typedef struct split {
    int axis;
    bool descending;
    float area;
} split;

// Sorts the pieces that are free to move.
static void pieces_sort(piece_list *list, int axis, bool descending)
{
    const uint32_t begin = list->first_fixed, end = list->count - list->last_fixed;
    const uint32_t count = end > begin ? end - begin : 0;
    sort_item *const items = memory_alloc(2 * (size_t)count * sizeof(sort_item));
    piece *const pieces = memory_alloc(count * sizeof(piece));
    for (uint32_t i = 0; i < count; i++) {
        pieces[i] = list->pieces[begin + i];
        const float centre = box_centre(&pieces[i].box, axis);
        items[i] = (sort_item){sortable(descending ? -centre : centre), i};
    }
    radix_sort(items, items + count, count);
    for (uint32_t i = 0; i < count; i++) {
        list->pieces[begin + i] = pieces[items[i].index];
    }
    free(items);
    free(pieces);
}

// The piece in which the half of the list falls; *offset: how much of it belongs to the first half, perhaps nothing.
static uint32_t half_find(const piece_list *list, uint32_t *offset)
{
    uint32_t index = 0, left = list->triangles / 2;
    while (list->pieces[index].count <= left) {
        left -= list->pieces[index++].count;
    }
    *offset = left;
    return index;
}

static float split_area(const triangle_sort *sort, const piece_list *list, int axis, bool descending)
{
    uint32_t offset;
    const uint32_t half = half_find(list, &offset);
    const piece *const cut = &list->pieces[half];
    const uint32_t end = cut->begin + cut->count, at = descending ? end - offset : cut->begin + offset;
    const box low = range_box(sort, axis, cut->begin, at), high = range_box(sort, axis, at, end);
    box first = descending ? high : low, second = descending ? low : high;
    for (uint32_t i = 0; i < list->count; i++) {
        if (i != half) {
            box_add(i < half ? &first : &second, list->pieces[i].box.min, list->pieces[i].box.max);
        }
    }
    return box_half_area(&first) + box_half_area(&second);
}

static split best_split(const triangle_sort *sort, piece_list *list)
{
    split best = {.area = INFINITY};
    for (int candidate = 0; candidate < 6; candidate++) {
        const int axis = candidate % 3;
        const bool descending = candidate >= 3;
        pieces_sort(list, axis, descending);
        const float area = split_area(sort, list, axis, descending);
        if (area < best.area) {
            best = (split){axis, descending, area};
        }
    }
    return best;
}

// Cuts the piece across the half in two, the second of which is inserted behind it; returns the number of pieces in the
// first half. `list->pieces` has room for one more.
static uint32_t half_cut(triangle_sort *sort, piece_list *list, split split)
{
    uint32_t offset;
    const uint32_t half = half_find(list, &offset);
    if (offset == 0) {
        return half;
    }
    piece *const first = &list->pieces[half];
    const uint32_t end = first->begin + first->count;
    range_cut(sort, split.axis, split.descending, first->begin, split.descending ? end - offset : first->begin + offset,
              end);
    memmove(first + 1, first, (list->count - half) * sizeof(piece));
    list->count++;
    first[0].count = offset;
    first[1].begin += offset;
    first[1].count -= offset;
    first[0].box = range_box(sort, 0, first[0].begin, first[1].begin);
    first[1].box = range_box(sort, 0, first[1].begin, end);
    return half + 1;
}

static piece_list list_part(const piece_list *list, uint32_t begin, uint32_t end)
{
    // Room for one more piece: see half_cut.
    piece_list part = {.pieces = memory_alloc((end - begin + 1) * sizeof(piece)), .count = end - begin};
    memcpy(part.pieces, list->pieces + begin, part.count * sizeof(piece));
    for (uint32_t i = 0; i < part.count; i++) {
        part.triangles += part.pieces[i].count;
    }
    return part;
}

static void primitive_emit(triangle_sort *sort, const piece *piece)
{
    if (sort->sequence_count == 0 || sort->sequence[sort->sequence_count - 1] != piece->primitive) {
        sort->sequence[sort->sequence_count++] = piece->primitive;
    }
    median_split(sort, piece->begin, piece->begin + piece->count);
}

// Takes list->pieces.
static void pieces_split(triangle_sort *sort, piece_list list)
{
    if (list.count == 1) {
        primitive_emit(sort, &list.pieces[0]);
        free(list.pieces);
        return;
    }
    const split split = best_split(sort, &list);
    pieces_sort(&list, split.axis, split.descending);
    const uint32_t before = list.count;
    const uint32_t half = half_cut(sort, &list, split);
    const bool cut = list.count > before;
    piece_list first = list_part(&list, 0, half), second = list_part(&list, half, list.count);
    first.first_fixed = list.first_fixed;
    first.last_fixed = cut;
    second.first_fixed = cut;
    second.last_fixed = list.last_fixed;
    free(list.pieces);
    pieces_split(sort, first);
    pieces_split(sort, second);
}

static void indices_permute(gltf_primitive *primitive, uint32_t begin, const uint32_t *triangles)
{
    uint32_t *const indices = memory_alloc(primitive->index_count * sizeof(uint32_t));
    for (uint32_t i = 0; i < primitive->index_count / 3; i++) {
        memcpy(indices + 3 * (size_t)i, primitive->indices + 3 * (size_t)(triangles[i] - begin), 3 * sizeof(uint32_t));
    }
    memcpy(primitive->indices, indices, primitive->index_count * sizeof(uint32_t));
    free(indices);
}

void mesh_triangles_reorder(gltf_primitive *primitives, uint32_t count, uint32_t *sequence)
{
    uint32_t triangle_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        triangle_count += primitives[i].index_count / 3;
    }
    triangle_sort sort;
    sort_init(&sort, triangle_count, count);
    piece_list list = {.pieces = memory_alloc((count + 1) * sizeof(piece)), .triangles = triangle_count};
    uint32_t *const begins = memory_alloc(count * sizeof(uint32_t));
    uint32_t begin = 0, empty_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t triangles = primitives[i].index_count / 3;
        begins[i] = begin;
        if (triangles == 0) {
            sequence[count - ++empty_count] = i; // those without triangles come last
            continue;
        }
        sort_add(&sort, begin, primitives[i].indices, triangles, (const float(*)[3])primitives[i].positions);
        list.pieces[list.count++] = (piece){begin, triangles, i, range_box(&sort, 0, begin, begin + triangles)};
        begin += triangles;
    }
    if (list.count > 0) {
        pieces_split(&sort, list);
    } else {
        free(list.pieces);
    }
    for (uint32_t i = 0, done = 0; i < sort.sequence_count; i++) {
        const uint32_t primitive = sort.sequence[i];
        indices_permute(&primitives[primitive], begins[primitive], sort.result + done);
        done += primitives[primitive].index_count / 3;
        sequence[i] = primitive;
    }
    free(begins);
    arena_fini(&sort.memory);
}
