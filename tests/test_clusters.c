// Clusters of triangles: what they leave out cannot be seen, and their corners draw the same triangles.
#include "modules/clusters.h"
#include "test.h"

enum { COLUMNS = 48, ROWS = 32, VERTICES = (COLUMNS + 1) * (ROWS + 1), TRIANGLES = 2 * COLUMNS * ROWS };
enum { CLUSTERS = (TRIANGLES + CLUSTER_TRIANGLES - 1) / CLUSTER_TRIANGLES };

typedef struct globe { // a stretched sphere, wound so that its outside is the front, the triangles ordered as in scenes
    float positions[VERTICES][3];
    uint32_t indices[3 * TRIANGLES];
    cluster clusters[CLUSTERS];
} globe;

static void globe_init(globe *g)
{
    for (int row = 0; row <= ROWS; row++)
        for (int column = 0; column <= COLUMNS; column++) {
            const double polar = M_PI * row / ROWS, turn = 2 * M_PI * column / COLUMNS;
            float *p = g->positions[row * (COLUMNS + 1) + column];
            p[0] = (float)(3 * sin(polar) * cos(turn));
            p[1] = (float)(sin(polar) * sin(turn));
            p[2] = (float)(2 * cos(polar));
        }
    uint32_t *index = g->indices;
    for (uint32_t row = 0; row < ROWS; row++)
        for (uint32_t column = 0; column < COLUMNS; column++) {
            const uint32_t a = row * (COLUMNS + 1) + column, b = a + COLUMNS + 1;
            const uint32_t quad[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(index, quad, sizeof quad);
            index += 6;
        }
    scene_primitive_reorder(g->indices, 3 * TRIANGLES, (const float(*)[3])g->positions);
    clusters_make(g->indices, 3 * TRIANGLES, (const float(*)[3])g->positions, VERTICES, g->clusters);
}

// How far the eye is on the front side of a triangle; in double.
static double front_side(const globe *g, uint32_t triangle, const float eye[3])
{
    double edges[2][3], to_eye[3], sum = 0;
    for (int k = 0; k < 3; k++) {
        const double a = (double)g->positions[g->indices[3 * triangle]][k];
        edges[0][k] = (double)g->positions[g->indices[3 * triangle + 1]][k] - a;
        edges[1][k] = (double)g->positions[g->indices[3 * triangle + 2]][k] - a;
        to_eye[k] = (double)eye[k] - a;
    }
    for (int k = 0; k < 3; k++)
        sum +=
            to_eye[k] * (edges[0][(k + 1) % 3] * edges[1][(k + 2) % 3] - edges[0][(k + 2) % 3] * edges[1][(k + 1) % 3]);
    return sum;
}

static uint32_t random_state = 1;

static float random_unit(void) // xorshift; in [0,1)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return (float)(random_state >> 8) / 16777216;
}

TEST(bounds_hold_every_corner)
{
    static globe g;
    globe_init(&g);
    for (uint32_t i = 0; i < 3 * TRIANGLES; i++) {
        const cluster *c = &g.clusters[i / (3 * CLUSTER_TRIANGLES)];
        const float *p = g.positions[g.indices[i]];
        double square = 0;
        for (int k = 0; k < 3; k++) {
            CHECK(p[k] >= c->bounds.min[k] && p[k] <= c->bounds.max[k]);
            square += pow((double)p[k] - (double)c->centre[k], 2);
        }
        CHECK(sqrt(square) <= 1.0001 * (double)c->radius);
    }
}

TEST(a_cluster_that_faces_away_has_no_front)
{
    static globe g;
    globe_init(&g);
    uint32_t away = 0, hidden = 0, wrong = 0;
    for (int sample = 0; sample < 500; sample++) {
        float eye[3];
        for (int k = 0; k < 3; k++)
            eye[k] = 20 * random_unit() - 10;
        for (uint32_t i = 0; i < CLUSTERS; i++) {
            uint32_t fronts = 0;
            for (uint32_t t = i * CLUSTER_TRIANGLES; t < min_u32((i + 1) * CLUSTER_TRIANGLES, TRIANGLES); t++)
                fronts += front_side(&g, t, eye) > 0;
            const bool faces_away = cluster_faces_away(&g.clusters[i], eye);
            away += faces_away;
            hidden += fronts == 0;
            wrong += faces_away && fronts > 0;
        }
    }
    printf("  of %u clusters without a front %u are found\n", hidden, away);
    CHECK(wrong == 0);
    CHECK(hidden > 1000 && away > hidden / 2);
}

TEST(from_inside_no_cluster_of_inward_triangles_is_left_out)
{
    static globe g;
    globe_init(&g);
    for (uint32_t t = 0; t < TRIANGLES; t++) {
        const uint32_t second = g.indices[3 * t + 1];
        g.indices[3 * t + 1] = g.indices[3 * t + 2];
        g.indices[3 * t + 2] = second;
    }
    clusters_make(g.indices, 3 * TRIANGLES, (const float(*)[3])g.positions, VERTICES, g.clusters);
    for (uint32_t i = 0; i < CLUSTERS; i++)
        CHECK(!cluster_faces_away(&g.clusters[i], (float[3]){0.1f, 0.2f, -0.3f}));
}

TEST(corners_draw_the_same_triangles_and_few_vertices)
{
    static globe g;
    static uint32_t corners[3 * TRIANGLES];
    static bool used[3 * TRIANGLES];
    globe_init(&g);
    corners_order(g.indices, 3 * TRIANGLES, VERTICES, corners);
    uint32_t distinct = 0;
    for (uint32_t t = 0; t < TRIANGLES; t++) {
        CHECK(corners[3 * t] / 3 == t); // by which the vertex shader knows the triangle
        const uint32_t turn = corners[3 * t] % 3;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t number = corners[3 * t + k];
            CHECK(number < 3 * TRIANGLES && g.indices[number] == g.indices[3 * t + (turn + k) % 3]);
            CHECK(number / (3 * CLUSTER_TRIANGLES) == t / CLUSTER_TRIANGLES); // clusters are drawn one by one
            distinct += !used[number];
            used[number] = true;
        }
    }
    printf("  %.2f vertices a triangle\n", (double)distinct / TRIANGLES);
    CHECK(distinct < 1.3 * TRIANGLES);
}

TEST(a_flat_cluster_is_left_out_from_behind_alone)
{
    static const float positions[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    cluster c;
    clusters_make(indices, 6, positions, 4, &c);
    CHECK(!cluster_faces_away(&c, (float[3]){0.5f, 0.5f, 2}));
    CHECK(cluster_faces_away(&c, (float[3]){0.5f, 0.5f, -2}));
    clusters_make(indices, 0, positions, 4, &c); // writes nothing
}

int main(void)
{
    RUN(bounds_hold_every_corner);
    RUN(a_cluster_that_faces_away_has_no_front);
    RUN(from_inside_no_cluster_of_inward_triangles_is_left_out);
    RUN(corners_draw_the_same_triangles_and_few_vertices);
    RUN(a_flat_cluster_is_left_out_from_behind_alone);
    return test_end();
}
