// Triangle meshes as recipes; see the header.
#include "tools/make_scenes_mesh.h"

#include <math.h>
#include <stdlib.h>

enum { PROFILE_MAX = 64 };
static const float pi = 3.14159265358979f;

vec3 vec3_cross(vec3 a, vec3 b)
{
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

vec3 vec3_normalize(vec3 a)
{
    const float length = sqrtf(vec3_dot(a, a));
    return length > 0 ? vec3_scale(a, 1 / length) : a;
}

vec3 vec3_yaw(vec3 a, float radians)
{
    const float c = cosf(radians), s = sinf(radians);
    return (vec3){c * a.x + s * a.z, a.y, c * a.z - s * a.x};
}

float random_uniform(random_sequence *sequence, float low, float high)
{
    // PCG-XSH-RR, O'Neill 2014.
    const uint64_t state = sequence->state;
    sequence->state = state * 6364136223846793005ull + 1442695040888963407ull;
    const uint32_t shifted = (uint32_t)(((state >> 18) ^ state) >> 27), turn = (uint32_t)(state >> 59);
    const uint32_t bits = shifted >> turn | shifted << (-turn & 31);
    return low + (high - low) * (float)(bits >> 8) * 0x1p-24f;
}

void mesh_fini(mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->indices);
}

static float repeat_of(const mesh *mesh)
{
    return mesh->repeat > 0 ? mesh->repeat : 1;
}

uint32_t mesh_vertex_add(mesh *mesh, vec3 position, vec3 normal, vec2 uv)
{
    memory_reserve((void **)&mesh->vertices, &mesh->vertex_capacity, mesh->vertex_count + 1, sizeof(mesh_vertex));
    mesh->vertices[mesh->vertex_count] = (mesh_vertex){
        .position = vec3_add(vec3_yaw(position, mesh->yaw), mesh->origin),
        .normal = vec3_normalize(vec3_yaw(normal, mesh->yaw)),
        .uv = uv,
    };
    return (uint32_t)mesh->vertex_count++;
}

static vec3 corner_of(const mesh *mesh, size_t index)
{
    return mesh->vertices[mesh->indices[index]].position;
}

// Degenerate triangles, as at the pole of a turned solid, are left out.
void mesh_triangle_add(mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    const vec3 pa = mesh->vertices[a].position;
    const vec3 pb = mesh->vertices[b].position, pc = mesh->vertices[c].position;
    const vec3 area = vec3_cross(vec3_sub(pb, pa), vec3_sub(pc, pa));
    if (vec3_dot(area, area) < 1e-16f)
        return;
    memory_reserve((void **)&mesh->indices, &mesh->index_capacity, mesh->index_count + 3, sizeof(uint32_t));
    mesh->indices[mesh->index_count++] = a;
    mesh->indices[mesh->index_count++] = b;
    mesh->indices[mesh->index_count++] = c;
}

// A closed surface has no net area vector, and one that faces outwards has a positive volume.
static void assert_solid(const mesh *mesh, size_t first_index)
{
    double volume = 0, net[3] = {0}, area = 0;
    for (size_t i = first_index; i < mesh->index_count; i += 3) {
        const vec3 a = vec3_sub(corner_of(mesh, i), mesh->origin);
        const vec3 b = vec3_sub(corner_of(mesh, i + 1), mesh->origin);
        const vec3 c = vec3_sub(corner_of(mesh, i + 2), mesh->origin);
        const vec3 twice_area = vec3_cross(vec3_sub(b, a), vec3_sub(c, a));
        volume += vec3_dot(a, vec3_cross(b, c)) / 6;
        area += sqrt(vec3_dot(twice_area, twice_area));
        net[0] += twice_area.x, net[1] += twice_area.y, net[2] += twice_area.z;
    }
    assert(volume > 0);
    assert(fabs(net[0]) + fabs(net[1]) + fabs(net[2]) < 1e-4 * area);
    (void)volume, (void)area, (void)net;
}

// Projects along the normal's largest axis, so that U runs to the right and V down as seen from in front.
static vec2 flat_uv(const mesh *mesh, vec3 position, vec3 normal)
{
    const float ax = fabsf(normal.x), ay = fabsf(normal.y), az = fabsf(normal.z);
    vec2 uv = {normal.z > 0 ? position.x : -position.x, -position.y};
    if (ay >= ax && ay >= az)
        uv = (vec2){position.x, normal.y > 0 ? position.z : -position.z};
    else if (ax >= az)
        uv = (vec2){normal.x > 0 ? -position.z : position.z, -position.y};
    if (mesh->grain_up)
        uv = (vec2){-uv.y, uv.x};
    return (vec2){uv.x / repeat_of(mesh), uv.y / repeat_of(mesh)};
}

void mesh_quad_add(mesh *mesh, vec3 a, vec3 b, vec3 c, vec3 d)
{
    const vec3 normal = vec3_normalize(vec3_cross(vec3_sub(c, a), vec3_sub(d, b)));
    const uint32_t first = mesh_vertex_add(mesh, a, normal, flat_uv(mesh, a, normal));
    mesh_vertex_add(mesh, b, normal, flat_uv(mesh, b, normal));
    mesh_vertex_add(mesh, c, normal, flat_uv(mesh, c, normal));
    mesh_vertex_add(mesh, d, normal, flat_uv(mesh, d, normal));
    mesh_triangle_add(mesh, first, first + 1, first + 2);
    mesh_triangle_add(mesh, first, first + 2, first + 3);
}

void mesh_box_add(mesh *mesh, vec3 low, vec3 high)
{
    const vec2 sides[2] = {{0, low.y}, {0, high.y}};
    const vec3 origin = mesh->origin, centre = vec3_scale(vec3_add(low, high), 0.5f);
    mesh->origin = vec3_add(origin, vec3_yaw((vec3){centre.x, 0, centre.z}, mesh->yaw));
    mesh_block_add(mesh, (high.x - low.x) / 2, (high.z - low.z) / 2, sides, 2);
    mesh->origin = origin;
}

// One straight piece of a profile: its ends with their shading normals, and how far along the profile they lie.
typedef struct profile_piece {
    vec2 point[2], normal[2];
    float along[2];
    bool level, straight; // as a floor or a ceiling; or either that or as a wall
} profile_piece;

static vec2 vec2_normalize(vec2 a)
{
    const float length = sqrtf(a.x * a.x + a.y * a.y);
    return (vec2){a.x / length, a.y / length};
}

static vec2 piece_normal(const vec2 *profile, size_t count, size_t piece)
{
    const vec2 a = profile[piece % count], b = profile[(piece + 1) % count];
    return vec2_normalize((vec2){b.y - a.y, a.x - b.x});
}

static vec2 shading_normal(vec2 own, vec2 neighbour)
{
    const float cos_crease = 0.76f;
    if (own.x * neighbour.x + own.y * neighbour.y < cos_crease)
        return own;
    return vec2_normalize((vec2){own.x + neighbour.x, own.y + neighbour.y});
}

// Returns the number of pieces.
static size_t profile_cut(const vec2 *profile, size_t count, bool closed, profile_piece pieces[static PROFILE_MAX])
{
    const size_t piece_count = closed ? count : count - 1;
    assert(count >= 2 && piece_count <= PROFILE_MAX);
    float along = 0;
    for (size_t i = 0; i < piece_count; i++) {
        const vec2 a = profile[i], b = profile[(i + 1) % count], own = piece_normal(profile, count, i);
        const bool has_previous = closed || i > 0, has_next = closed || i + 1 < piece_count;
        const float end = along + hypotf(b.x - a.x, b.y - a.y);
        const vec2 previous = has_previous ? piece_normal(profile, count, i + count - 1) : own;
        const vec2 next = has_next ? piece_normal(profile, count, i + 1) : own;
        pieces[i] = (profile_piece){
            .point = {a, b},
            .normal = {shading_normal(own, previous), shading_normal(own, next)},
            .along = {along, end},
            .level = fabsf(own.y) > 0.98f,
            .straight = fabsf(own.y) > 0.98f || fabsf(own.x) > 0.999f,
        };
        along = end;
    }
    return piece_count;
}

// Joins two rows of `count` vertices, the second above the first, when both run to the right as seen from in front.
static void rows_join(mesh *mesh, uint32_t lower, uint32_t upper, uint32_t count)
{
    for (uint32_t i = 0; i + 1 < count; i++) {
        mesh_triangle_add(mesh, lower + i, lower + i + 1, upper + i + 1);
        mesh_triangle_add(mesh, lower + i, upper + i + 1, upper + i);
    }
}

static vec3 turned(float radius, float y, float angle)
{
    return (vec3){radius * sinf(angle), y, radius * cosf(angle)};
}

static uint32_t lathe_row_add(mesh *mesh, const profile_piece *piece, int end, uint32_t segments, float repeats)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    for (uint32_t i = 0; i <= segments; i++) {
        // The last column repeats the first one exactly, so that the seam is shut.
        const float angle = 2 * pi * (float)(i % segments) / (float)segments;
        const vec3 position = turned(piece->point[end].x, piece->point[end].y, angle);
        const vec3 normal = turned(piece->normal[end].x, piece->normal[end].y, angle);
        const vec2 around = {repeats * (float)i / (float)segments, -piece->along[end] / repeat_of(mesh)};
        mesh_vertex_add(mesh, position, normal, piece->level ? flat_uv(mesh, position, normal) : around);
    }
    return first;
}

void mesh_lathe_add(mesh *mesh, const vec2 *profile, size_t count, uint32_t segments)
{
    // Flat discs down to the axis close what the recipe leaves open.
    vec2 closed[PROFILE_MAX];
    size_t closed_count = 0;
    float radius = 0;
    assert(count + 2 <= PROFILE_MAX);
    if (profile[0].x > 0)
        closed[closed_count++] = (vec2){0, profile[0].y};
    for (size_t i = 0; i < count; i++) {
        closed[closed_count++] = profile[i];
        radius = fmaxf(radius, profile[i].x);
    }
    if (profile[count - 1].x > 0)
        closed[closed_count++] = (vec2){0, profile[count - 1].y};

    const size_t first_index = mesh->index_count;
    const float repeats = fmaxf(1, roundf(2 * pi * radius / repeat_of(mesh)));
    profile_piece pieces[PROFILE_MAX];
    const size_t piece_count = profile_cut(closed, closed_count, false, pieces);
    for (size_t i = 0; i < piece_count; i++) {
        const uint32_t lower = lathe_row_add(mesh, &pieces[i], 0, segments, repeats);
        const uint32_t upper = lathe_row_add(mesh, &pieces[i], 1, segments, repeats);
        rows_join(mesh, lower, upper, segments + 1);
    }
    assert_solid(mesh, first_index);
}

void mesh_fluted_shaft_add(mesh *mesh, float radius_bottom, float radius_top, float bottom, float top, uint32_t flutes)
{
    enum { ROWS = 4, CUTS = 4 };
    const float repeats = fmaxf(1, roundf(2 * pi * radius_bottom / repeat_of(mesh)));
    for (uint32_t flute = 0; flute < flutes; flute++) {
        const uint32_t first = (uint32_t)mesh->vertex_count;
        for (uint32_t row = 0; row < ROWS; row++) {
            const float t = (float)row / (ROWS - 1), y = bottom + t * (top - bottom);
            const float radius = radius_bottom + (radius_top - radius_bottom) * t * t;
            const float depth = 0.3f * pi * radius / (float)flutes;
            for (uint32_t cut = 0; cut < CUTS; cut++) {
                const float s = (float)cut / (CUTS - 1), turn = ((float)flute + s) / (float)flutes;
                const float angle = 2 * pi * (turn < 1 ? turn : 0), scoop = sinf(pi * s);
                // d(radius)/d(angle) of the scoop tilts the normal towards the flute's middle.
                const float slope = -depth * pi * cosf(pi * s) * (float)flutes / (2 * pi * radius);
                const vec3 out = turned(1, 0, angle), right = turned(1, 0, angle + pi / 2);
                mesh_vertex_add(mesh, turned(radius - depth * scoop, y, angle), vec3_sub(out, vec3_scale(right, slope)),
                                (vec2){repeats * turn, -y / repeat_of(mesh)});
            }
            if (row > 0)
                rows_join(mesh, first + (row - 1) * CUTS, first + row * CUTS, CUTS);
        }
    }
}

// Sweeps a profile along the four sides of a rectangle. A side is built facing +Z and turned into its place.
static void rectangle_sweep(mesh *mesh, float half_x, float half_z, const profile_piece *pieces, size_t count)
{
    for (int side = 0; side < 4; side++) {
        const float half_along = side % 2 ? half_z : half_x, half_out = side % 2 ? half_x : half_z;
        for (size_t i = 0; i < count; i++) {
            const uint32_t first = (uint32_t)mesh->vertex_count;
            for (int corner = 0; corner < 4; corner++) {
                const int end = corner / 2;
                const vec2 point = pieces[i].point[end], normal = pieces[i].normal[end];
                vec3 p = {(half_along + point.x) * (corner % 2 ? 1.0f : -1.0f), point.y, half_out + point.x};
                vec3 n = {0, normal.y, normal.x};
                vec2 uv = {p.x / repeat_of(mesh), -pieces[i].along[end] / repeat_of(mesh)};
                // Quarter turns by exchange, which keeps the corners exactly together.
                for (int turn = 0; turn < side; turn++) {
                    p = (vec3){p.z, p.y, -p.x};
                    n = (vec3){n.z, n.y, -n.x};
                }
                if (pieces[i].straight)
                    uv = flat_uv(mesh, p, n);
                else if (mesh->grain_up)
                    uv = (vec2){-uv.y, uv.x};
                mesh_vertex_add(mesh, p, n, uv);
            }
            rows_join(mesh, first, first + 2, 2);
        }
    }
}

void mesh_block_add(mesh *mesh, float half_x, float half_z, const vec2 *profile, size_t count)
{
    const size_t first_index = mesh->index_count;
    profile_piece pieces[PROFILE_MAX];
    rectangle_sweep(mesh, half_x, half_z, pieces, profile_cut(profile, count, false, pieces));

    const vec2 bottom = profile[0], top = profile[count - 1];
    const float bx = half_x + bottom.x, bz = half_z + bottom.x, tx = half_x + top.x, tz = half_z + top.x;
    mesh_quad_add(mesh, (vec3){-bx, bottom.y, -bz}, (vec3){bx, bottom.y, -bz}, (vec3){bx, bottom.y, bz},
                  (vec3){-bx, bottom.y, bz});
    mesh_quad_add(mesh, (vec3){-tx, top.y, tz}, (vec3){tx, top.y, tz}, (vec3){tx, top.y, -tz}, (vec3){-tx, top.y, -tz});
    assert_solid(mesh, first_index);
}

void mesh_frame_add(mesh *mesh, float half_x, float half_z, const vec2 *profile, size_t count)
{
    const size_t first_index = mesh->index_count;
    profile_piece pieces[PROFILE_MAX];
    rectangle_sweep(mesh, half_x, half_z, pieces, profile_cut(profile, count, true, pieces));
    assert_solid(mesh, first_index);
}

// The solid between two heights over a stretch of the wall, without its ends: front, back, top and flat underside.
static void wall_strip_add(mesh *mesh, const mesh_arcade_desc *desc, vec2 left, vec2 right, bool underside)
{
    const float z = desc->half_thickness, top = desc->top;
    const vec3 a = {left.x, left.y, z}, b = {right.x, right.y, z}, c = {right.x, top, z}, d = {left.x, top, z};
    const vec3 back = {0, 0, -2 * z};
    mesh_quad_add(mesh, a, b, c, d);
    mesh_quad_add(mesh, vec3_add(b, back), vec3_add(a, back), vec3_add(d, back), vec3_add(c, back));
    mesh_quad_add(mesh, d, c, vec3_add(c, back), vec3_add(d, back));
    if (underside)
        mesh_quad_add(mesh, vec3_add(a, back), vec3_add(b, back), b, a);
}

// Points of an arch from its left foot (t = 0) over the crown to its right foot (t = 1), exact at both feet.
static vec2 arch_point(const mesh_arcade_desc *desc, float centre, float t)
{
    const float y = t <= 0 || t >= 1 ? 0 : desc->rise * sinf(pi * t);
    return (vec2){centre - desc->half_span * cosf(pi * t), desc->springing + y};
}

static void intrados_add(mesh *mesh, const mesh_arcade_desc *desc, float centre)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    for (uint32_t i = 0; i <= desc->segments; i++) {
        const float t = (float)i / (float)desc->segments, z = desc->half_thickness;
        const vec2 point = arch_point(desc, centre, t);
        const vec3 normal = {cosf(pi * t) / desc->half_span, -sinf(pi * t) / desc->rise, 0};
        const float along = pi * t * desc->half_span / repeat_of(mesh);
        mesh_vertex_add(mesh, (vec3){point.x, point.y, z}, normal, (vec2){along, -z / repeat_of(mesh)});
        mesh_vertex_add(mesh, (vec3){point.x, point.y, -z}, normal, (vec2){along, z / repeat_of(mesh)});
        if (i > 0) {
            const uint32_t a = first + 2 * i - 2;
            mesh_triangle_add(mesh, a, a + 1, a + 3);
            mesh_triangle_add(mesh, a, a + 3, a + 2);
        }
    }
}

void mesh_arcade_add(mesh *mesh, const mesh_arcade_desc *desc)
{
    const size_t first_index = mesh->index_count;
    const float half_length = (float)desc->bays * desc->pitch / 2, z = desc->half_thickness;
    for (uint32_t bay = 0; bay < desc->bays; bay++) {
        const float left = (float)bay * desc->pitch - half_length, right = (float)(bay + 1) * desc->pitch - half_length;
        const float centre = (left + right) / 2;
        vec2 previous = arch_point(desc, centre, 0);
        wall_strip_add(mesh, desc, (vec2){left, desc->springing}, previous, true);
        for (uint32_t i = 1; i <= desc->segments; i++) {
            const vec2 point = arch_point(desc, centre, (float)i / (float)desc->segments);
            wall_strip_add(mesh, desc, previous, point, false);
            previous = point;
        }
        wall_strip_add(mesh, desc, previous, (vec2){right, desc->springing}, true);
        intrados_add(mesh, desc, centre);
    }
    for (int end = -1; end <= 1; end += 2) {
        const float x = half_length * (float)end, facing = z * (float)end;
        mesh_quad_add(mesh, (vec3){x, desc->springing, facing}, (vec3){x, desc->springing, -facing},
                      (vec3){x, desc->top, -facing}, (vec3){x, desc->top, facing});
    }
    assert_solid(mesh, first_index);
}

void mesh_archivolt_add(mesh *mesh, float radius, float springing, const vec2 *profile, size_t count, uint32_t segments)
{
    const size_t first_index = mesh->index_count;
    profile_piece pieces[PROFILE_MAX];
    const size_t piece_count = profile_cut(profile, count, true, pieces);
    for (size_t i = 0; i < piece_count; i++) {
        const uint32_t first = (uint32_t)mesh->vertex_count;
        for (int end = 0; end < 2; end++) {
            const vec2 point = pieces[i].point[end], normal = pieces[i].normal[end];
            for (uint32_t j = 0; j <= segments; j++) {
                const float angle = pi * (float)j / (float)segments, c = cosf(angle), s = sinf(angle);
                const float out = radius + point.x;
                const vec2 uv = {angle * radius / repeat_of(mesh), -pieces[i].along[end] / repeat_of(mesh)};
                mesh_vertex_add(mesh, (vec3){c * out, springing + s * out, point.y},
                                (vec3){c * normal.x, s * normal.x, normal.y}, uv);
            }
        }
        rows_join(mesh, first, first + segments + 1, segments + 1);
    }
    for (int end = -1; end <= 1; end += 2) {
        const uint32_t first = (uint32_t)mesh->vertex_count;
        // The same rounded cosine and sine as above, so that the caps meet the ring.
        const float angle = end < 0 ? pi : 0, c = cosf(angle), s = sinf(angle);
        for (size_t i = 0; i < count; i++) {
            const float out = radius + profile[i].x;
            const vec3 p = {c * out, springing + s * out, profile[i].y};
            mesh_vertex_add(mesh, p, (vec3){0, -1, 0}, flat_uv(mesh, p, (vec3){0, -1, 0}));
        }
        for (uint32_t i = 1; i + 1 < count; i++)
            mesh_triangle_add(mesh, first, first + i + (end > 0 ? 0 : 1), first + i + (end > 0 ? 1 : 0));
    }
    assert_solid(mesh, first_index);
}

// One of the four webs: rows from the crown to the edge; `across` and `out` in [-1, 1] are turned by quarter turns.
static void vault_web_add(mesh *mesh, int web, vec3 half, float springing, float top, uint32_t segments)
{
    const uint32_t rows = segments / 2, first = (uint32_t)mesh->vertex_count;
    vec3 edge[PROFILE_MAX];
    assert(segments < PROFILE_MAX);
    for (uint32_t row = 0; row <= rows; row++) {
        const float out = row == rows ? 1 : sinf(pi / 2 * (float)row / (float)rows);
        for (uint32_t i = 0; i <= segments; i++) {
            const float side = i == 0 ? -1 : i == segments ? 1 : sinf(pi * ((float)i / (float)segments - 0.5f));
            const float across = side * out, height = sqrtf(fmaxf(0, 1 - across * across));
            vec3 p = {across, 0, out}, n = {-across, -height, 0};
            for (int turn = 0; turn < web; turn++) {
                p = (vec3){p.z, 0, -p.x};
                n = (vec3){n.z, n.y, -n.x};
            }
            p = (vec3){p.x * half.x, springing + height * half.y, p.z * half.z};
            n = (vec3){n.x / half.x, n.y / half.y, n.z / half.z};
            const vec2 uv = {asinf(across) * half.y / repeat_of(mesh), -out * half.z / repeat_of(mesh)};
            mesh_vertex_add(mesh, p, n, uv);
            edge[i] = p;
        }
        if (row > 0)
            rows_join(mesh, first + (row - 1) * (segments + 1), first + row * (segments + 1), segments + 1);
    }
    for (uint32_t i = 0; i < segments; i++) {
        const vec3 a = edge[i], b = edge[i + 1], c = {b.x, top, b.z}, d = {a.x, top, a.z};
        mesh_quad_add(mesh, a, b, c, d);
        mesh_quad_add(mesh, d, c, (vec3){0, top, 0}, (vec3){0, top, 0});
    }
}

void mesh_groin_vault_add(mesh *mesh, float half_x, float half_z, float rise, float springing, float top,
                          uint32_t segments)
{
    const size_t first_index = mesh->index_count;
    for (int web = 0; web < 4; web++)
        vault_web_add(mesh, web, (vec3){half_x, rise, half_z}, springing, top, segments);
    assert_solid(mesh, first_index);
}

void mesh_sheet_add(mesh *mesh, uint32_t columns, uint32_t rows, vec2 uv_low, vec2 uv_high,
                    mesh_sheet_position position, const void *user)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    const float step = 1e-3f;
    for (uint32_t row = 0; row <= rows; row++) {
        const float t = (float)row / (float)rows;
        for (uint32_t column = 0; column <= columns; column++) {
            const float s = (float)column / (float)columns;
            const vec3 ds = vec3_sub(position(s + step, t, user), position(s - step, t, user));
            const vec3 dt = vec3_sub(position(s, t + step, user), position(s, t - step, user));
            const vec2 uv = {uv_low.x + s * (uv_high.x - uv_low.x), uv_low.y + t * (uv_high.y - uv_low.y)};
            mesh_vertex_add(mesh, position(s, t, user), vec3_cross(dt, ds), uv);
        }
        if (row > 0)
            rows_join(mesh, first + row * (columns + 1), first + (row - 1) * (columns + 1), columns + 1);
    }
}
