// Subdivision against OpenSubdiv's other ways to the limit surface, and against closed forms.
extern "C" {
#include "modules/subdivision.h"
}
#include "test.h"

#include <algorithm>
#include <array>
#include <memory>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/stencilTableFactory.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <set>
#include <vector>

namespace
{

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

typedef std::vector<uint32_t> numbers;

struct point {
    float p[3];

    void Clear(void * = nullptr) { p[0] = p[1] = p[2] = 0; }
    void AddWithWeight(const point &other, float weight)
    {
        for (int k = 0; k < 3; k++) {
            p[k] += weight * other.p[k];
        }
    }
};

point cross(const point &a, const point &b)
{
    return {{a.p[1] * b.p[2] - a.p[2] * b.p[1], a.p[2] * b.p[0] - a.p[0] * b.p[2], a.p[0] * b.p[1] - a.p[1] * b.p[0]}};
}

point unit(const point &v)
{
    const float length = sqrtf(v.p[0] * v.p[0] + v.p[1] * v.p[1] + v.p[2] * v.p[2]);
    return {{v.p[0] / length, v.p[1] / length, v.p[2] / length}};
}

float distance(const point &a, const point &b)
{
    return sqrtf((a.p[0] - b.p[0]) * (a.p[0] - b.p[0]) + (a.p[1] - b.p[1]) * (a.p[1] - b.p[1]) +
                 (a.p[2] - b.p[2]) * (a.p[2] - b.p[2]));
}

// A cage with what it refers to. Every vertex has one value, which is zero, unless the test says otherwise.
struct cage {
    subdivision_scheme scheme = SUBDIVISION_CATMARK;
    subdivision_boundary boundary = SUBDIVISION_EDGE_AND_CORNER;
    std::vector<point> positions;
    numbers sizes, corners, corner_values;
    std::vector<std::array<float, SUBDIVISION_VALUES>> values;
    std::vector<subdivision_crease> creases;

    subdivision_cage plain(uint32_t max_level)
    {
        if (values.empty()) {
            corner_values = corners;
            values.resize(positions.size());
        }
        subdivision_cage result = {};
        result.scheme = scheme;
        result.boundary = boundary;
        result.max_level = max_level;
        result.vertex_count = static_cast<uint32_t>(positions.size());
        result.face_count = static_cast<uint32_t>(sizes.size());
        result.face_sizes = sizes.data();
        result.corners = corners.data();
        result.corner_values = corner_values.data();
        result.values = reinterpret_cast<const float(*)[SUBDIVISION_VALUES]>(values.data());
        result.value_count = static_cast<uint32_t>(values.size());
        result.creases = creases.data();
        result.crease_count = static_cast<uint32_t>(creases.size());
        return result;
    }
};

struct refined {
    arena memory = {};
    subdivision result = {};
    char reason[256] = "";
    bool ok;

    refined(cage &c, uint32_t max_level)
    {
        const subdivision_cage plain = c.plain(max_level);
        ok = subdivision_refine(&plain, &memory, &result, reason);
    }
    ~refined() { arena_fini(&memory); }
    refined(const refined &) = delete;
    refined &operator=(const refined &) = delete;

    void evaluate(const cage &c, uint32_t stencil, point v[3]) const
    {
        float out[3][3];
        subdivision_evaluate(&result.stencils, stencil, reinterpret_cast<const float(*)[3]>(c.positions.data()), out);
        for (int i = 0; i < 3; i++) {
            std::copy_n(out[i], 3, v[i].p);
        }
    }
};

// ---- Cages

cage cube_make()
{
    cage c;
    for (int i = 0; i < 8; i++) {
        c.positions.push_back({{i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f}});
    }
    c.sizes.assign(6, 4);
    c.corners = {0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6};
    return c;
}

// Asymmetric, so that no mistake in the order of things can hide.
cage bent_cube_make()
{
    cage c = cube_make();
    for (size_t i = 0; i < c.positions.size(); i++) {
        for (int k = 0; k < 3; k++) {
            c.positions[i].p[k] += 0.4f * sinf(3.0f * static_cast<float>(i) + 5.0f * static_cast<float>(k));
        }
    }
    return c;
}

cage octahedron_make()
{
    cage c;
    c.scheme = SUBDIVISION_LOOP;
    for (int i = 0; i < 6; i++) {
        c.positions.push_back({{0, 0, 0}});
        c.positions.back().p[i / 2] = i % 2 ? -1.0f : 1.0f;
    }
    c.sizes.assign(8, 3);
    for (uint32_t i = 0; i < 8; i++) {
        const uint32_t x = i & 1, y = 2 + (i >> 1 & 1), z = 4 + (i >> 2 & 1);
        const bool mirrored = ((i ^ i >> 1 ^ i >> 2) & 1) != 0;
        c.corners.insert(c.corners.end(), {x, mirrored ? z : y, mirrored ? y : z});
    }
    return c;
}

// Quads of size 1 in the plane z = 0, facing +z, from the origin on.
cage plane_make(uint32_t width, uint32_t height)
{
    cage c;
    for (uint32_t i = 0; i < (width + 1) * (height + 1); i++) {
        c.positions.push_back({{static_cast<float>(i % (width + 1)), static_cast<float>(i / (width + 1)), 0}});
    }
    for (uint32_t i = 0; i < width * height; i++) {
        const uint32_t corner = i % width + i / width * (width + 1);
        c.sizes.push_back(4);
        c.corners.insert(c.corners.end(), {corner, corner + 1, corner + width + 2, corner + width + 1});
    }
    return c;
}

void edges_crease(cage &c, float sharpness)
{
    for (size_t f = 0; f < c.sizes.size(); f++) {
        for (size_t k = 0; k < 4; k++) {
            const uint32_t a = c.corners[4 * f + k], b = c.corners[4 * f + (k + 1) % 4];
            if (a < b) {
                c.creases.push_back({{a, b}, sharpness});
            }
        }
    }
}

// ---- The library's own evaluation

std::unique_ptr<Far::TopologyRefiner> library_refiner(const cage &c)
{
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(c.boundary == SUBDIVISION_EDGE ? Sdc::Options::VTX_BOUNDARY_EDGE_ONLY
                                                                       : Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER);
    std::vector<int> crease_vertices;
    std::vector<float> weights;
    for (const subdivision_crease &crease : c.creases) {
        crease_vertices.insert(crease_vertices.end(), crease.vertices, crease.vertices + 2);
        weights.push_back(crease.sharpness);
    }
    Far::TopologyDescriptor descriptor;
    descriptor.numVertices = static_cast<int>(c.positions.size());
    descriptor.numFaces = static_cast<int>(c.sizes.size());
    descriptor.numVertsPerFace = reinterpret_cast<const int *>(c.sizes.data());
    descriptor.vertIndicesPerFace = reinterpret_cast<const int *>(c.corners.data());
    descriptor.numCreases = static_cast<int>(c.creases.size());
    descriptor.creaseVertexIndexPairs = crease_vertices.data();
    descriptor.creaseWeights = weights.data();
    typedef Far::TopologyRefinerFactory<Far::TopologyDescriptor> factory;
    const Sdc::SchemeType type = c.scheme == SUBDIVISION_LOOP ? Sdc::SCHEME_LOOP : Sdc::SCHEME_CATMARK;
    return std::unique_ptr<Far::TopologyRefiner>(factory::Create(descriptor, factory::Options(type, options)));
}

struct limit_surface { // of the vertices of one level
    std::vector<point> positions, normals;
};

// Refines positions level by level, then takes them to the limit.
limit_surface library_limit(const cage &c, int level)
{
    const std::unique_ptr<Far::TopologyRefiner> refiner = library_refiner(c);
    Far::TopologyRefiner::UniformOptions uniform(level);
    uniform.fullTopologyInLastLevel = true;
    refiner->RefineUniform(uniform);
    const Far::PrimvarRefinerReal<float> primvars(*refiner);
    std::vector<point> points = c.positions;
    for (int i = 1; i <= level; i++) {
        std::vector<point> finer(static_cast<size_t>(refiner->GetLevel(i).GetNumVertices()));
        primvars.Interpolate(i, points, finer);
        points.swap(finer);
    }
    limit_surface result;
    std::vector<point> tangents[2];
    result.positions.resize(points.size());
    tangents[0].resize(points.size());
    tangents[1].resize(points.size());
    primvars.Limit(points, result.positions, tangents[0], tangents[1]);
    for (size_t i = 0; i < points.size(); i++) {
        result.normals.push_back(unit(cross(tangents[0][i], tangents[1][i])));
    }
    return result;
}

// Our stencils follow the library's vertices, one or more for each. Every one has to be there, and one of its normals.
void compare_with_limit(cage &c, uint32_t level)
{
    const refined r(c, level);
    CHECK(r.ok);
    const limit_surface expected = library_limit(c, static_cast<int>(level));
    uint32_t stencil = 0;
    float worst = 0, worst_normal = 0;
    for (size_t v = 0; v < expected.positions.size(); v++) {
        float nearest_normal = INFINITY;
        uint32_t count = 0;
        for (; stencil < r.result.stencils.count; stencil++, count++) {
            point at[3];
            r.evaluate(c, stencil, at);
            const float off = distance(at[0], expected.positions[v]);
            if (off > 1e-3f && count > 0) {
                break; // the next vertex's
            }
            worst = std::max(worst, off);
            nearest_normal = std::min(nearest_normal, distance(unit(cross(at[1], at[2])), expected.normals[v]));
        }
        worst_normal = std::max(worst_normal, nearest_normal);
    }
    CHECK(stencil == r.result.stencils.count);
    CHECK_NEAR(worst, 0, 1e-5);
    CHECK_NEAR(worst_normal, 0, 1e-4);
}

TEST(limit_positions_and_normals_are_the_librarys)
{
    cage cube = cube_make(), bent = bent_cube_make(), octahedron = octahedron_make();
    compare_with_limit(cube, 4);
    compare_with_limit(bent, 4);
    compare_with_limit(octahedron, 4);
}

TEST(limits_of_creases_and_boundaries_are_the_librarys)
{
    cage bent = bent_cube_make();
    bent.creases = {{{0, 1}, 10}, {{1, 3}, 10}, {{3, 2}, 10}, {{4, 5}, 2.5f}, {{5, 7}, 1.0f}};
    compare_with_limit(bent, 3);
    cage open = bent_cube_make();
    open.sizes.resize(5);
    open.corners.resize(20);
    compare_with_limit(open, 3);
    open.boundary = SUBDIVISION_EDGE;
    compare_with_limit(open, 3);
    cage half = octahedron_make();
    half.sizes.resize(4);
    half.corners.resize(12);
    half.positions.resize(5);
    compare_with_limit(half, 3);
}

// Bicubic patches with Gregory patches at the corners: another way to the same surface.
TEST(limit_positions_lie_where_the_librarys_patches_do)
{
    enum { LEVEL = 4, SIDE = 1 << LEVEL };
    cage c = bent_cube_make();
    const refined r(c, LEVEL);
    const std::unique_ptr<Far::TopologyRefiner> refiner = library_refiner(c);
    refiner->RefineAdaptive(Far::TopologyRefiner::AdaptiveOptions(LEVEL));
    std::vector<float> s, t;
    for (int i = 0; i < (SIDE + 1) * (SIDE + 1); i++) {
        s.push_back(static_cast<float>(i % (SIDE + 1)) / SIDE);
        t.push_back(static_cast<float>(i / (SIDE + 1)) / SIDE);
    }
    typedef Far::LimitStencilTableFactoryReal<float> factory;
    factory::LocationArrayVec locations(1);
    locations[0].ptexIdx = 3;
    locations[0].numLocations = static_cast<int>(s.size());
    locations[0].s = s.data();
    locations[0].t = t.data();
    const std::unique_ptr<const Far::LimitStencilTableReal<float>> table(factory::Create(*refiner, locations));
    CHECK(table && table->GetNumStencils() == static_cast<int>(s.size()));
    std::vector<point> points(s.size());
    table->UpdateValues(c.positions, points);
    float worst = 0;
    for (const point &expected : points) {
        float nearest = INFINITY;
        for (uint32_t i = 0; i < r.result.stencils.count; i++) {
            point at[3];
            r.evaluate(c, i, at);
            nearest = std::min(nearest, distance(at[0], expected));
        }
        worst = std::max(worst, nearest);
    }
    CHECK_NEAR(worst, 0, 1e-5);
}

// ---- Closed forms

// How many of the level's vertices lie at a corner of the cube of this half size, to rounding.
int corners_count(const refined &r, const cage &c, uint32_t level, float half)
{
    int count = 0;
    for (uint32_t i = 0; i < r.result.levels[level - 1].vertex_count; i++) {
        point at[3];
        r.evaluate(c, r.result.levels[level - 1].vertices[i].stencil, at);
        bool is_corner = true;
        for (int k = 0; k < 3; k++) {
            is_corner = is_corner && fabsf(fabsf(at[0].p[k]) - half) < 1e-6f;
        }
        count += is_corner;
    }
    return count;
}

TEST(a_cubes_corners_go_half_way_to_its_centre)
{
    // (n^2 v + 4 sum e + sum f) / (n (n + 5)) with n = 3 (Halstead, Kass and DeRose 1993).
    cage c = cube_make();
    const refined r(c, 4);
    for (uint32_t level = 1; level <= 4; level++) {
        CHECK(corners_count(r, c, level, 0.5f) == 8);
    }
}

TEST(an_octahedrons_and_a_tetrahedrons_vertices_have_loops_limits)
{
    // (1 - n x) v + x sum e with x = 1 / (3 / (8 b) + n), b = (5/8 - (3/8 + cos(2 pi / n) / 4)^2) / n (Loop 1987).
    cage octahedron = octahedron_make();
    const refined r(octahedron, 3);
    float farthest = 0;
    for (uint32_t i = 0; i < r.result.levels[0].vertex_count; i++) {
        point at[3];
        r.evaluate(octahedron, r.result.levels[0].vertices[i].stencil, at);
        farthest = std::max(farthest, at[0].p[0]);
    }
    CHECK_NEAR(farthest, 96.0 / 220.0, 1e-6);

    cage tetrahedron;
    tetrahedron.scheme = SUBDIVISION_LOOP;
    tetrahedron.positions = {{{1, 1, 1}}, {{1, -1, -1}}, {{-1, 1, -1}}, {{-1, -1, 1}}};
    tetrahedron.sizes.assign(4, 3);
    tetrahedron.corners = {0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2};
    const refined s(tetrahedron, 3);
    CHECK(s.ok && corners_count(s, tetrahedron, 3, 0.2f) == 4);
}

// ---- Creases and boundaries

TEST(a_cube_of_sharp_edges_stays_a_cube)
{
    cage c = cube_make();
    edges_crease(c, SUBDIVISION_SHARP);
    const refined r(c, 3);
    CHECK(r.ok && r.result.levels[2].vertex_count == 6 * 9 * 9); // each face has vertices of its own
    for (uint32_t i = 0; i < r.result.stencils.count; i++) {
        point at[3];
        r.evaluate(c, i, at);
        const point normal = unit(cross(at[1], at[2]));
        int axis = 0;
        for (int k = 1; k < 3; k++) {
            axis = fabsf(normal.p[k]) > fabsf(normal.p[axis]) ? k : axis;
        }
        CHECK_NEAR(fabsf(normal.p[axis]), 1, 1e-6);
        CHECK_NEAR(at[0].p[axis], normal.p[axis], 1e-6); // on that face, and the normal points outwards
    }
    CHECK(corners_count(r, c, 3, 1) == 24);
}

TEST(a_finite_crease_rounds_the_edge_a_little)
{
    float lowest[3];
    const float sharpness[3] = {0, 1.5f, SUBDIVISION_SHARP};
    for (int i = 0; i < 3; i++) {
        cage c = cube_make();
        c.creases = {{{4, 5}, sharpness[i]}, {{5, 7}, sharpness[i]}, {{7, 6}, sharpness[i]}, {{6, 4}, sharpness[i]}};
        const refined r(c, 3);
        lowest[i] = INFINITY; // of the ring's corners, along z
        for (uint32_t k = 0; k < r.result.stencils.count; k++) {
            point at[3];
            r.evaluate(c, k, at);
            if (fabsf(at[0].p[0] - at[0].p[1]) < 1e-6f && at[0].p[0] > 0.3f && at[0].p[2] > 0.2f) {
                lowest[i] = std::min(lowest[i], 1 - at[0].p[2]);
            }
        }
    }
    CHECK_NEAR(lowest[2], 0, 1e-6); // a sharp ring stays in its plane
    CHECK(lowest[0] > lowest[1] + 0.02f && lowest[1] > lowest[2] + 0.001f);
}

TEST(boundaries_are_interpolated_by_their_rule)
{
    for (int rule = 0; rule < 2; rule++) {
        cage c = plane_make(2, 2);
        c.boundary = rule == 0 ? SUBDIVISION_EDGE : SUBDIVISION_EDGE_AND_CORNER;
        const refined r(c, 3);
        CHECK(r.ok);
        uint32_t corners = 0, on_side = 0;
        for (uint32_t i = 0; i < r.result.stencils.count; i++) {
            point at[3];
            r.evaluate(c, i, at);
            const float x = at[0].p[0], y = at[0].p[1];
            corners += (x == 0 || x == 2) && (y == 0 || y == 2);
            on_side += fabsf(y) < 1e-6f;
            CHECK_NEAR(unit(cross(at[1], at[2])).p[2], 1, 1e-6);
        }
        CHECK(corners == (rule == 0 ? 0u : 4u));
        CHECK(rule == 0 || on_side == 17);
    }
}

// ---- Values, levels, refusals

TEST(seams_of_values_are_kept)
{
    static const float uv[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    cage c = cube_make();
    for (uint32_t i = 0; i < c.corners.size(); i++) {
        c.corner_values.push_back(i);
        c.values.push_back({uv[i % 4][0], uv[i % 4][1]});
    }
    const refined r(c, 2);
    const subdivision_level *const level = &r.result.levels[1];
    CHECK(r.ok && r.result.stencils.count == 98 && level->vertex_count == 6 * 25);
    uint32_t corners = 0;
    for (uint32_t i = 0; i < level->vertex_count; i++) {
        const float *const value = r.result.values[level->vertices[i].value];
        CHECK(value[0] >= 0 && value[0] <= 1 && value[1] >= 0 && value[1] <= 1);
        corners += (value[0] == 0 || value[0] == 1) && (value[1] == 0 || value[1] == 1);
    }
    CHECK(corners == 24);
    for (uint32_t i = 0; i < level->triangle_count; i++) { // no triangle reaches over a seam
        float least[2] = {1, 1}, most[2] = {0, 0};
        for (uint32_t k = 0; k < 3; k++) {
            const float *const value = r.result.values[level->vertices[level->indices[3 * i + k]].value];
            for (int j = 0; j < 2; j++) {
                least[j] = std::min(least[j], value[j]);
                most[j] = std::max(most[j], value[j]);
            }
        }
        CHECK(most[0] - least[0] < 0.5f && most[1] - least[1] < 0.5f);
    }
}

TEST(values_without_seams_go_to_their_limit)
{
    cage c = bent_cube_make();
    c.corner_values = c.corners;
    for (const point &p : c.positions) {
        c.values.push_back({p.p[0], p.p[1], p.p[2]});
    }
    const refined r(c, 3);
    for (const subdivision_level &level : r.result.levels) {
        for (uint32_t i = 0; i < level.vertex_count; i++) {
            point at[3];
            r.evaluate(c, level.vertices[i].stencil, at);
            const float *const value = r.result.values[level.vertices[i].value];
            CHECK_NEAR(distance(at[0], {{value[0], value[1], value[2]}}), 0, 1e-5);
        }
    }
}

TEST(a_level_has_the_vertices_of_the_one_before)
{
    cage c = bent_cube_make();
    const refined r(c, 4);
    std::set<uint32_t> before;
    for (uint32_t level = 1; level <= 4; level++) {
        const subdivision_level *const l = &r.result.levels[level - 1];
        CHECK(l->triangle_count == 12u << 2 * level && l->vertex_count == (6u << 2 * level) + 2);
        std::set<uint32_t> now;
        for (uint32_t i = 0; i < l->vertex_count; i++) {
            now.insert(l->vertices[i].stencil);
        }
        CHECK(std::includes(now.begin(), now.end(), before.begin(), before.end()));
        before = now;
    }
}

TEST(triangles_face_as_the_cage_does)
{
    cage c = cube_make();
    const refined r(c, 3);
    const subdivision_level *const level = &r.result.levels[2];
    for (uint32_t i = 0; i < level->triangle_count; i++) {
        point corners[3][3];
        for (uint32_t k = 0; k < 3; k++) {
            r.evaluate(c, level->vertices[level->indices[3 * i + k]].stencil, corners[k]);
        }
        point e, f;
        float outwards = 0;
        for (int k = 0; k < 3; k++) {
            e.p[k] = corners[1][0].p[k] - corners[0][0].p[k];
            f.p[k] = corners[2][0].p[k] - corners[0][0].p[k];
        }
        const point normal = cross(e, f);
        for (int k = 0; k < 3; k++) {
            outwards += normal.p[k] * corners[0][0].p[k];
        }
        CHECK(outwards > 0 && level->faces[i] < 6);
    }
}

TEST(faces_that_meet_in_a_vertex_alone_are_refused)
{
    cage c = plane_make(1, 1);
    for (const point &p : std::vector<point>(c.positions)) {
        c.positions.push_back({{p.p[0] + 1, p.p[1] + 1, p.p[2]}});
    }
    c.sizes.push_back(4);
    c.corners.insert(c.corners.end(), {3, 5, 7, 6}); // its first corner is the other's last
    c.positions.erase(c.positions.begin() + 4);
    for (size_t i = 5; i < 8; i++) {
        c.corners[i]--;
    }
    const refined r(c, 2);
    CHECK(!r.ok && strstr(r.reason, "fan"));
}

TEST(too_many_faces_at_a_vertex_are_refused)
{
    cage c;
    c.scheme = SUBDIVISION_LOOP;
    c.positions = {{{0, 0, 0}}};
    for (uint32_t i = 0; i < 65; i++) {
        const float angle = 6.2831853f * static_cast<float>(i) / 65;
        c.positions.push_back({{cosf(angle), sinf(angle), 0}});
        c.sizes.push_back(3);
        c.corners.insert(c.corners.end(), {0, 1 + i, 1 + (i + 1) % 65});
    }
    const refined r(c, 1);
    CHECK(!r.ok && strstr(r.reason, "more than 64 faces"));
}

TEST(too_many_triangles_are_refused)
{
    cage c = plane_make(40, 40);
    const refined r(c, 5);
    CHECK(!r.ok && strstr(r.reason, "triangles"));
}

} // namespace

int main()
{
    RUN(limit_positions_and_normals_are_the_librarys);
    RUN(limits_of_creases_and_boundaries_are_the_librarys);
    RUN(limit_positions_lie_where_the_librarys_patches_do);
    RUN(a_cubes_corners_go_half_way_to_its_centre);
    RUN(an_octahedrons_and_a_tetrahedrons_vertices_have_loops_limits);
    RUN(a_cube_of_sharp_edges_stays_a_cube);
    RUN(a_finite_crease_rounds_the_edge_a_little);
    RUN(boundaries_are_interpolated_by_their_rule);
    RUN(seams_of_values_are_kept);
    RUN(values_without_seams_go_to_their_limit);
    RUN(a_level_has_the_vertices_of_the_one_before);
    RUN(triangles_face_as_the_cage_does);
    RUN(faces_that_meet_in_a_vertex_alone_are_refused);
    RUN(too_many_faces_at_a_vertex_are_refused);
    RUN(too_many_triangles_are_refused);
    return test_end();
}
