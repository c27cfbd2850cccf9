// The shim over OpenSubdiv (Far and Sdc): see subdivision.h.
extern "C" {
#include "subdivision.h"
}

#include <algorithm>
#include <memory>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/stencilTableFactory.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace
{

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;
using refiner_factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
using stencil_factory = Far::StencilTableFactoryReal<double>;
using stencil_table = Far::StencilTableReal<double>;

thread_local std::string library_message; // the library's last word

void library_error(Far::ErrorType, const char *message)
{
    library_message = message;
}

void library_warning(const char *) {}

// ---- The refined topology

Sdc::Options scheme_options(const subdivision_cage &cage)
{
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(cage.boundary == SUBDIVISION_EDGE ? Sdc::Options::VTX_BOUNDARY_EDGE_ONLY
                                                                          : Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER);
    options.SetFVarLinearInterpolation(Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1);
    return options;
}

Sdc::SchemeType scheme_type(const subdivision_cage &cage)
{
    return cage.scheme == SUBDIVISION_LOOP ? Sdc::SCHEME_LOOP : Sdc::SCHEME_CATMARK;
}

// The library takes signed numbers.
const int *signed_of(const uint32_t *numbers)
{
    return reinterpret_cast<const int *>(numbers);
}

std::unique_ptr<Far::TopologyRefiner> refiner_make(const subdivision_cage &cage)
{
    std::vector<int> crease_vertices;
    std::vector<float> crease_weights;
    for (uint32_t i = 0; i < cage.crease_count; i++) {
        const subdivision_crease &crease = cage.creases[i];
        crease_vertices.insert(crease_vertices.end(), crease.vertices, crease.vertices + 2);
        crease_weights.push_back(std::min(crease.sharpness, static_cast<float>(SUBDIVISION_SHARP)));
    }
    Far::TopologyDescriptor::FVarChannel channel;
    channel.numValues = static_cast<int>(cage.value_count);
    channel.valueIndices = signed_of(cage.corner_values);

    Far::TopologyDescriptor descriptor;
    descriptor.numVertices = static_cast<int>(cage.vertex_count);
    descriptor.numFaces = static_cast<int>(cage.face_count);
    descriptor.numVertsPerFace = signed_of(cage.face_sizes);
    descriptor.vertIndicesPerFace = signed_of(cage.corners);
    descriptor.numCreases = static_cast<int>(cage.crease_count);
    descriptor.creaseVertexIndexPairs = crease_vertices.data();
    descriptor.creaseWeights = crease_weights.data();
    descriptor.numFVarChannels = 1;
    descriptor.fvarChannels = &channel;

    refiner_factory::Options options(scheme_type(cage), scheme_options(cage));
    options.validateFullTopology = true;
    library_message = "OpenSubdiv refuses its topology";
    std::unique_ptr<Far::TopologyRefiner> refiner(refiner_factory::Create(descriptor, options));
    if (!refiner) {
        throw std::runtime_error(library_message);
    }
    Far::TopologyRefiner::UniformOptions uniform(static_cast<int>(cage.max_level));
    uniform.fullTopologyInLastLevel = true;
    refiner->RefineUniform(uniform);
    return refiner;
}

// ---- Limit stencils. The masks of the finest level's vertices (Sdc) over the library's stencils of these.

struct mask { // what Sdc::Scheme fills in
    typedef double Weight;

    std::vector<double> vertex, edges, faces;
    int vertex_count = 0, edge_count = 0, face_count = 0;

    explicit mask(int valence) : vertex(1), edges(static_cast<size_t>(valence)), faces(static_cast<size_t>(valence)) {}
    void SetNumVertexWeights(int count) { vertex_count = count; }
    void SetNumEdgeWeights(int count) { edge_count = count; }
    void SetNumFaceWeights(int count) { face_count = count; }
    void SetFaceWeightsForFaceCenters(bool) {}
    double &VertexWeight(int i) { return vertex[static_cast<size_t>(i)]; }
    double &EdgeWeight(int i) { return edges[static_cast<size_t>(i)]; }
    double &FaceWeight(int i) { return faces[static_cast<size_t>(i)]; }
};

// Part of a vertex's neighbourhood, counter-clockwise: all of it, or the faces from one sharp edge to the next. To
// Sdc::Scheme the latter is a boundary vertex, which has the same rules as a side of a sharp edge.
struct sector {
    bool whole;
    std::vector<int> edges; // vertices at their other ends
    std::vector<int> opposites; // vertices across the faces, [i] between edges i and i + 1
    std::vector<int> faces;

    int GetNumEdges() const { return static_cast<int>(edges.size()); }
    int GetNumFaces() const { return static_cast<int>(faces.size()); }
    void GetSharpnessPerEdge(float sharpness[]) const
    {
        std::fill_n(sharpness, edges.size(), 0.0f);
        if (!whole) {
            sharpness[0] = sharpness[edges.size() - 1] = Sdc::Crease::SHARPNESS_INFINITE;
        }
    }
};

bool is_sharp(const Far::TopologyLevel &level, int edge)
{
    return level.IsEdgeBoundary(edge) || level.GetEdgeSharpness(edge) > 0;
}

int other_end(const Far::TopologyLevel &level, int edge, int vertex)
{
    const auto ends = level.GetEdgeVertices(edge);
    return ends[0] == vertex ? ends[1] : ends[0];
}

sector sector_take(const Far::TopologyLevel &level, int vertex, int first, int face_count, bool whole)
{
    const auto edges = level.GetVertexEdges(vertex);
    const auto faces = level.GetVertexFaces(vertex);
    const auto places = level.GetVertexFaceLocalIndices(vertex);
    sector result = {whole, {}, {}, {}};
    for (int i = 0; i < face_count + (whole ? 0 : 1); i++) {
        result.edges.push_back(other_end(level, edges[(first + i) % edges.size()], vertex));
    }
    for (int i = 0; i < face_count; i++) {
        const int face = (first + i) % faces.size();
        const auto corners = level.GetFaceVertices(faces[face]);
        result.faces.push_back(faces[face]);
        result.opposites.push_back(corners[(places[face] + 2) % corners.size()]);
    }
    return result;
}

std::vector<sector> sectors_find(const Far::TopologyLevel &level, int vertex)
{
    const auto edges = level.GetVertexEdges(vertex);
    const int face_count = level.GetVertexFaces(vertex).size();
    std::vector<int> sharp;
    for (int i = 0; i < edges.size(); i++) {
        if (is_sharp(level, edges[i])) {
            sharp.push_back(i);
        }
    }
    std::vector<sector> sectors;
    if (sharp.size() < 2) { // smooth, or the end of a crease, which is smooth too
        sectors.push_back(sector_take(level, vertex, 0, face_count, true));
        return sectors;
    }
    const bool closed = edges.size() == face_count;
    for (size_t i = 0; i + (closed ? 0 : 1) < sharp.size(); i++) {
        const int next = i + 1 < sharp.size() ? sharp[i + 1] : sharp[0] + edges.size();
        sectors.push_back(sector_take(level, vertex, sharp[i], next - sharp[i], false));
    }
    return sectors;
}

struct stencil_builder {
    const stencil_table &table; // of the finest level's vertices
    std::vector<double> sums[3]; // by vertex of the cage; zero between stencils
    std::vector<char> touched_mark;
    std::vector<uint32_t> touched;
    std::vector<uint32_t> offsets;
    std::vector<subdivision_entry> entries;

    stencil_builder(const stencil_table &table, uint32_t cage_vertices)
        : table(table), touched_mark(cage_vertices), offsets{0}
    {
        for (std::vector<double> &sum : sums) {
            sum.resize(cage_vertices);
        }
    }

    void add(int which, int vertex, double weight)
    {
        const auto stencil = table.GetStencil(vertex);
        for (int i = 0; weight != 0 && i < stencil.GetSize(); i++) {
            const uint32_t to = static_cast<uint32_t>(stencil.GetVertexIndices()[i]);
            if (!touched_mark[to]) {
                touched_mark[to] = 1;
                touched.push_back(to);
            }
            sums[which][to] += weight * stencil.GetWeights()[i];
        }
    }

    void add(int which, int vertex, const sector &hood, const mask &m)
    {
        for (int i = 0; i < m.face_count; i++) {
            add(which, hood.opposites[static_cast<size_t>(i)], m.faces[static_cast<size_t>(i)]);
        }
        for (int i = 0; i < m.edge_count; i++) {
            add(which, hood.edges[static_cast<size_t>(i)], m.edges[static_cast<size_t>(i)]);
        }
        add(which, vertex, m.vertex_count > 0 ? m.vertex[0] : 0);
    }

    // Ends a stencil and returns its number.
    uint32_t finish()
    {
        std::sort(touched.begin(), touched.end());
        for (const uint32_t vertex : touched) {
            const double position = sums[0][vertex], tangent1 = sums[1][vertex], tangent2 = sums[2][vertex];
            sums[0][vertex] = sums[1][vertex] = sums[2][vertex] = 0;
            touched_mark[vertex] = 0;
            if (position != 0 || tangent1 != 0 || tangent2 != 0) {
                entries.push_back(
                    {vertex, static_cast<float>(position), static_cast<float>(tangent1), static_cast<float>(tangent2)});
            }
        }
        touched.clear();
        if (entries.size() > SUBDIVISION_ENTRIES_MAX) {
            throw std::runtime_error("its stencils have more than " + std::to_string(SUBDIVISION_ENTRIES_MAX) +
                                     " weights");
        }
        offsets.push_back(static_cast<uint32_t>(entries.size()));
        return static_cast<uint32_t>(offsets.size() - 2);
    }
};

template <Sdc::SchemeType TYPE>
uint32_t sector_stencil(const subdivision_cage &cage, const Far::TopologyLevel &level, int vertex, const sector &hood,
                        stencil_builder &builder)
{
    const Sdc::Scheme<TYPE> scheme(scheme_options(cage));
    mask masks[3] = {mask(hood.GetNumEdges()), mask(hood.GetNumEdges()), mask(hood.GetNumEdges())};
    scheme.ComputeVertexLimitMask(hood, masks[0], masks[1], masks[2], level.GetVertexRule(vertex));
    for (int i = 0; i < 3; i++) {
        builder.add(i, vertex, hood, masks[i]);
    }
    return builder.finish();
}

// Makes the stencils of the finest level; returns the stencil of each corner of its faces.
std::vector<uint32_t> stencils_make(const subdivision_cage &cage, const Far::TopologyRefiner &refiner,
                                    stencil_builder &builder)
{
    const Far::TopologyLevel &level = refiner.GetLevel(refiner.GetMaxLevel());
    const size_t size = cage.scheme == SUBDIVISION_LOOP ? 3 : 4;
    std::vector<uint32_t> stencil_of(static_cast<size_t>(level.GetNumFaces()) * size);
    for (int v = 0; v < level.GetNumVertices(); v++) {
        const auto faces = level.GetVertexFaces(v);
        const auto places = level.GetVertexFaceLocalIndices(v);
        for (const sector &hood : sectors_find(level, v)) {
            const uint32_t stencil = cage.scheme == SUBDIVISION_LOOP
                                         ? sector_stencil<Sdc::SCHEME_LOOP>(cage, level, v, hood, builder)
                                         : sector_stencil<Sdc::SCHEME_CATMARK>(cage, level, v, hood, builder);
            for (int i = 0; i < faces.size(); i++) {
                if (std::find(hood.faces.begin(), hood.faces.end(), faces[i]) != hood.faces.end()) {
                    stencil_of[static_cast<size_t>(faces[i]) * size + places[i]] = stencil;
                }
            }
        }
    }
    return stencil_of;
}

// ---- Face-varying values

struct face_value {
    double v[SUBDIVISION_VALUES];

    void Clear() { std::fill_n(v, SUBDIVISION_VALUES, 0.0); }
    void AddWithWeight(const face_value &other, double weight)
    {
        for (int i = 0; i < SUBDIVISION_VALUES; i++) {
            v[i] += weight * other.v[i];
        }
    }
};

// Those of the finest level at the limit.
std::vector<face_value> values_refine(const subdivision_cage &cage, const Far::TopologyRefiner &refiner)
{
    const Far::PrimvarRefinerReal<double> primvars(refiner);
    std::vector<face_value> values(cage.value_count);
    for (uint32_t i = 0; i < cage.value_count; i++) {
        std::copy_n(cage.values[i], SUBDIVISION_VALUES, values[i].v);
    }
    for (int level = 1; level <= refiner.GetMaxLevel(); level++) {
        std::vector<face_value> finer(static_cast<size_t>(refiner.GetLevel(level).GetNumFVarValues()));
        primvars.InterpolateFaceVarying(level, values, finer);
        values.swap(finer);
    }
    std::vector<face_value> limit(values.size());
    primvars.LimitFaceVarying(values, limit);
    return limit;
}

// ---- The levels' meshes

struct face_corner {
    int face, corner;
};

// Where a face's corner is in the next level: in the child face that has it.
face_corner corner_descend(const Far::TopologyLevel &level, const Far::TopologyLevel &finer, face_corner at)
{
    const int child = level.GetVertexChildVertex(level.GetFaceVertices(at.face)[at.corner]);
    const auto faces = level.GetFaceChildFaces(at.face);
    for (int i = 0; i < faces.size(); i++) {
        const auto corners = finer.GetFaceVertices(faces[i]);
        for (int k = 0; k < corners.size(); k++) {
            if (corners[k] == child) {
                return {faces[i], k};
            }
        }
    }
    throw std::runtime_error("a face's corner has no child");
}

struct level_builder {
    const Far::TopologyRefiner &refiner;
    const std::vector<uint32_t> &stencil_of; // of the finest level's corners
    std::unordered_map<uint64_t, uint32_t> numbers; // of stencil and value
    std::vector<subdivision_corner> vertices;
    std::vector<uint32_t> indices, faces;

    uint32_t vertex_at(int level, face_corner at)
    {
        const int finest = refiner.GetMaxLevel();
        for (; level < finest; level++) {
            at = corner_descend(refiner.GetLevel(level), refiner.GetLevel(level + 1), at);
        }
        const Far::TopologyLevel &last = refiner.GetLevel(finest);
        const size_t size = stencil_of.size() / static_cast<size_t>(last.GetNumFaces());
        const uint32_t stencil = stencil_of[static_cast<size_t>(at.face) * size + static_cast<size_t>(at.corner)];
        const uint32_t value = static_cast<uint32_t>(last.GetFaceFVarValues(at.face)[at.corner]);
        const auto found = numbers.emplace(static_cast<uint64_t>(stencil) << 32 | value, vertices.size());
        if (found.second) {
            vertices.push_back({stencil, value});
        }
        return found.first->second;
    }

    // `parents`: the cage's face of each face.
    void triangles_make(int level, const std::vector<uint32_t> &parents)
    {
        const Far::TopologyLevel &source = refiner.GetLevel(level);
        for (int f = 0; f < source.GetNumFaces(); f++) {
            const int size = source.GetFaceVertices(f).size();
            uint32_t corners[4];
            for (int k = 0; k < size; k++) {
                corners[k] = vertex_at(level, {f, k});
            }
            for (int k = 2; k < size; k++) {
                indices.insert(indices.end(), {corners[0], corners[k - 1], corners[k]});
                faces.push_back(parents[static_cast<size_t>(f)]);
            }
        }
    }
};

template <typename T> T *keep(arena *to, const std::vector<T> &from)
{
    T *const copy = static_cast<T *>(arena_alloc(to, from.size() * sizeof(T)));
    std::copy(from.begin(), from.end(), copy);
    return copy;
}

subdivision_level level_make(arena *arena, const Far::TopologyRefiner &refiner, int level,
                             const std::vector<uint32_t> &stencil_of, const std::vector<uint32_t> &parents)
{
    level_builder builder = {refiner, stencil_of, {}, {}, {}, {}};
    builder.triangles_make(level, parents);
    subdivision_level result = {};
    result.vertex_count = static_cast<uint32_t>(builder.vertices.size());
    result.triangle_count = static_cast<uint32_t>(builder.faces.size());
    result.vertices = keep(arena, builder.vertices);
    result.indices = keep(arena, builder.indices);
    result.faces = keep(arena, builder.faces);
    return result;
}

void levels_make(arena *arena, const Far::TopologyRefiner &refiner, const std::vector<uint32_t> &stencil_of,
                 subdivision &result)
{
    std::vector<uint32_t> parents(static_cast<size_t>(refiner.GetLevel(0).GetNumFaces()));
    for (size_t i = 0; i < parents.size(); i++) {
        parents[i] = static_cast<uint32_t>(i);
    }
    for (int level = 1; level <= refiner.GetMaxLevel(); level++) {
        const Far::TopologyLevel &source = refiner.GetLevel(level);
        std::vector<uint32_t> finer(static_cast<size_t>(source.GetNumFaces()));
        for (int f = 0; f < source.GetNumFaces(); f++) {
            finer[static_cast<size_t>(f)] = parents[static_cast<size_t>(source.GetFaceParentFace(f))];
        }
        parents.swap(finer);
        result.levels[level - 1] = level_make(arena, refiner, level, stencil_of, parents);
    }
}

// ---- The whole

// The neighbours of a vertex have no order where its faces do not form one fan.
void fans_check(const Far::TopologyRefiner &refiner)
{
    const Far::TopologyLevel &cage = refiner.GetLevel(0);
    if (refiner.GetMaxValence() > SUBDIVISION_VALENCE_MAX) {
        throw std::runtime_error("a vertex has more than " + std::to_string(SUBDIVISION_VALENCE_MAX) + " faces");
    }
    for (int v = 0; v < cage.GetNumVertices(); v++) {
        if (cage.IsVertexNonManifold(v) || cage.GetVertexFaces(v).size() == 0) {
            throw std::runtime_error("the faces at vertex " + std::to_string(v) + " do not form one fan");
        }
    }
}

void refine(const subdivision_cage &cage, arena *arena, subdivision &result)
{
    const std::unique_ptr<Far::TopologyRefiner> refiner = refiner_make(cage);
    fans_check(*refiner);
    stencil_factory::Options options;
    options.generateOffsets = true;
    options.generateIntermediateLevels = false;
    options.maxLevel = cage.max_level;
    const std::unique_ptr<const stencil_table> table(stencil_factory::Create(*refiner, options));
    stencil_builder builder(*table, cage.vertex_count);
    const std::vector<uint32_t> stencil_of = stencils_make(cage, *refiner, builder);
    result.stencils.count = static_cast<uint32_t>(builder.offsets.size() - 1);
    result.stencils.offsets = keep(arena, builder.offsets);
    result.stencils.entries = keep(arena, builder.entries);

    const std::vector<face_value> values = values_refine(cage, *refiner);
    result.value_count = static_cast<uint32_t>(values.size());
    result.values =
        static_cast<float(*)[SUBDIVISION_VALUES]>(arena_alloc(arena, values.size() * sizeof(*result.values)));
    for (size_t i = 0; i < values.size(); i++) {
        std::copy_n(values[i].v, SUBDIVISION_VALUES, result.values[i]);
    }
    levels_make(arena, *refiner, stencil_of, result);
}

} // namespace

extern "C" uint64_t subdivision_triangles(const subdivision_cage *cage, uint32_t level)
{
    uint64_t corners = 0;
    for (uint32_t i = 0; i < cage->face_count; i++) {
        corners += cage->face_sizes[i];
    }
    const uint64_t first = cage->scheme == SUBDIVISION_LOOP ? 4 * uint64_t{cage->face_count} : 2 * corners;
    return first << 2 * (level - 1);
}

extern "C" bool subdivision_refine(const subdivision_cage *cage, arena *arena, subdivision *result, char reason[256])
{
    *result = {};
    Far::SetErrorCallback(library_error);
    Far::SetWarningCallback(library_warning);
    try {
        if (subdivision_triangles(cage, cage->max_level) > SUBDIVISION_TRIANGLES_MAX) {
            throw std::runtime_error("level " + std::to_string(cage->max_level) + " has more than " +
                                     std::to_string(SUBDIVISION_TRIANGLES_MAX) + " triangles");
        }
        refine(*cage, arena, *result);
        return true;
    } catch (const std::exception &error) {
        snprintf(reason, 256, "%s", error.what());
        return false;
    }
}

extern "C" void subdivision_evaluate(const subdivision_stencils *stencils, uint32_t stencil,
                                     const float (*positions)[3], float result[3][3])
{
    std::fill_n(&result[0][0], 9, 0.0f);
    for (uint32_t i = stencils->offsets[stencil]; i < stencils->offsets[stencil + 1]; i++) {
        const subdivision_entry &entry = stencils->entries[i];
        const float weights[3] = {entry.position, entry.tangent1, entry.tangent2};
        for (int which = 0; which < 3; which++) {
            for (int k = 0; k < 3; k++) {
                result[which][k] += weights[which] * positions[entry.vertex][k];
            }
        }
    }
}
