// Control cages in glTF files: what becomes of them, and what is refused.
#include "subdivision_scene.h"

static const float *level_position(const scene_data *scene, const scene_subdivision_level *level, uint32_t vertex)
{
    return scene->positions[level->first_vertex + vertex];
}

static uint32_t mesh_triangles(const scene_data *scene, uint32_t mesh)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->meshes[mesh].primitive_count; i++) {
        count += scene->primitives[scene->meshes[mesh].first_primitive + i].index_count / 3;
    }
    return count;
}

TEST(a_cage_becomes_a_mesh_for_each_level)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *const scene = cube_load(&cube, 12, CATMARK, "");
    CHECK(scene && test_log.warnings == 0 && scene->subdivision_count == 1 && scene->mesh_count == 4);
    if (scene && scene->subdivision_count == 1) {
        const scene_subdivision *const s = &scene->subdivisions[0];
        CHECK(s->mesh == 0 && s->level_count == 3 && mesh_triangles(scene, 0) == 12);
        CHECK(scene->nodes[0].mesh == 0 && scene->instanced_triangles == 12);
        CHECK_NEAR(s->edge_length, 2, 1e-6);
        for (uint32_t level = 1; level <= 3; level++) {
            // Of quads: six become 24, 96 and 384; had the triangles stayed apart, it would be 36 and so on.
            CHECK(mesh_triangles(scene, s->levels[level - 1].mesh) == 12u << 2 * level);
        }
    }
    scene_destroy(scene);
}

TEST(a_levels_vertices_are_where_its_stencils_say)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *const scene = cube_load(&cube, 12, CATMARK, "");
    CHECK(scene && scene->subdivision_count == 1);
    for (uint32_t l = 0; scene && l < 3; l++) {
        const scene_subdivision *const s = &scene->subdivisions[0];
        const scene_subdivision_level *const level = &s->levels[l];
        uint32_t corners = 0;
        for (uint32_t i = 0; i < level->vertex_count; i++) {
            float v[3][3];
            subdivision_evaluate(&s->stencils, level->vertices[i].stencil, scene->positions + s->first_vertex, v);
            const float *const p = level_position(scene, level, i);
            const float *const n = scene->attributes[level->first_vertex + i].normal;
            CHECK(memcmp(v[0], p, sizeof(v[0])) == 0);
            CHECK_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-6);
            CHECK(n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > 0.5f); // outwards, and nowhere flat as the faces' own
            corners += fabsf(fabsf(p[0]) - 0.5f) < 1e-6f && fabsf(fabsf(p[1]) - 0.5f) < 1e-6f &&
                       fabsf(fabsf(p[2]) - 0.5f) < 1e-6f;
        }
        CHECK(corners == 24); // eight, three of each for the seams of the texture coordinates
    }
    scene_destroy(scene);
}

TEST(vertices_on_a_seam_share_place_and_normal)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *const scene = cube_load(&cube, 12, CATMARK, "");
    const scene_subdivision_level *const level = scene ? &scene->subdivisions[0].levels[2] : NULL;
    CHECK(level && level->vertex_count == 6 * 81);
    for (uint32_t i = 0; level && i < level->vertex_count; i++) {
        for (uint32_t k = 0; k < i; k++) {
            const vertex_attributes *const a = &scene->attributes[level->first_vertex + i],
                                           *const b = &scene->attributes[level->first_vertex + k];
            if (memcmp(level_position(scene, level, i), level_position(scene, level, k), 3 * sizeof(float)) == 0) {
                CHECK(memcmp(a->normal, b->normal, sizeof(a->normal)) == 0);
                CHECK(memcmp(a->uv0, b->uv0, sizeof(a->uv0)) != 0);
            }
        }
    }
    scene_destroy(scene);
}

TEST(tangents_follow_the_texture_coordinates)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *const scene =
        cube_load(&cube, 12, CATMARK,
                  ",'materials':[{'normalTexture':{'index':0}}],'textures':[{'source':0}],"
                  "'images':[{'uri':'data:image/"
                  "png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGA"
                  "WjR9awAAAABJRU5ErkJggg=='}]");
    CHECK(scene && scene->subdivision_count == 1);
    const scene_subdivision *const s = scene ? &scene->subdivisions[0] : NULL;
    for (uint32_t i = 0; s && i < s->levels[2].vertex_count; i++) {
        const subdivision_vertex *const vertex = &s->levels[2].vertices[i];
        const vertex_attributes *const a = &scene->attributes[s->levels[2].first_vertex + i];
        float v[3][3], tangent[3];
        subdivision_evaluate(&s->stencils, vertex->stencil, scene->positions + s->first_vertex, v);
        CHECK(a->tangent[3] != 0);
        for (int k = 0; k < 3; k++) {
            tangent[k] = vertex->tangent[0] * v[1][k] + vertex->tangent[1] * v[2][k];
            CHECK_NEAR(tangent[k], a->tangent[k], 1e-5);
        }
    }
    scene_destroy(scene);
}

TEST(creases_are_given_by_vertices)
{
    const cube_bytes cube = cube_bytes_make();
    // The edges of face 5, which faces +z: its vertices are 20 to 23. The last one is a diagonal.
    scene_data *const scene = cube_load(&cube, 12,
                                        "{'lanternfield_subdivision':{'scheme':'catmark','max_level':2,'creases':["
                                        "[20,21,10],[21,22,10],[22,23,10.0],[23,20,12],[20,22,10]]}}",
                                        "");
    CHECK(scene && scene->subdivision_count == 1 && test_log.warnings == 1);
    CHECK(strstr(test_log.warning, "mesh 0 \"cube\"") && strstr(test_log.warning, "1 of its creases"));
    uint32_t flat = 0;
    for (uint32_t i = 0; scene && i < scene->subdivisions[0].levels[1].vertex_count; i++) {
        const scene_subdivision_level *const level = &scene->subdivisions[0].levels[1];
        const float *const n = scene->attributes[level->first_vertex + i].normal;
        flat += fabsf(n[2] - 1) < 1e-6f && fabsf(level_position(scene, level, i)[2] - 1) < 1e-6f;
    }
    CHECK(flat == 25); // the creased face is flat up to its edge
    scene_destroy(scene);
}

TEST(triangles_of_a_loop_cage_stay_apart)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *const scene = cube_load(&cube, 12, "{'lanternfield_subdivision':{'scheme':'loop','max_level':2}}", "");
    CHECK(scene && scene->subdivision_count == 1 && mesh_triangles(scene, 2) == 12 * 16);
    scene_destroy(scene);
}

TEST(what_is_no_quad_stays_two_triangles)
{
    cube_bytes cube = cube_bytes_make();
    for (uint32_t i = 0; i < 24; i++) { // the corner (1, 1, 1) far out: three faces bend by more than 30 degrees
        if (cube.positions[i][0] > 0 && cube.positions[i][1] > 0 && cube.positions[i][2] > 0) {
            cube.positions[i][0] = cube.positions[i][1] = cube.positions[i][2] = 9;
        }
    }
    scene_data *const scene = cube_load(&cube, 12, CATMARK, "");
    CHECK(scene && scene->subdivision_count == 1);
    CHECK(scene && mesh_triangles(scene, 1) == 3 * 4 * 2 + 6 * 3 * 2); // a quad makes four quads, a triangle three
    scene_destroy(scene);
}

// ---- Refused

static void check_drawn_as_it_is(const cube_bytes *cube, uint32_t triangles, const char *extras, const char *reason)
{
    scene_data *const scene = cube_load(cube, triangles, extras, "");
    CHECK(scene && scene->subdivision_count == 0 && scene->mesh_count == 1 && scene->index_count >= 36);
    CHECK(test_log.errors == 0);
    const char *const warning = scene && scene->warning_count > 0 ? scene->warnings[0] : "";
    if (!strstr(warning, "mesh 0 \"cube\"") || !strstr(warning, reason)) {
        CHECK_STRING(warning, reason);
    }
    scene_destroy(scene);
}

TEST(a_non_manifold_cage_is_refused_by_name_and_drawn_as_it_is)
{
    cube_bytes cube = cube_bytes_make();
    memcpy(cube.indices + 36, (uint16_t[]){0, 1, 22}, 6); // a third face on the edge between vertices 0 and 1
    check_drawn_as_it_is(&cube, 13, CATMARK, "more than two faces");
}

TEST(faces_that_do_not_face_the_same_way_are_refused)
{
    cube_bytes cube = cube_bytes_make();
    for (int i = 0; i < 6; i += 3) {
        const uint16_t second = cube.indices[i + 1];
        cube.indices[i + 1] = cube.indices[i + 2];
        cube.indices[i + 2] = second;
    }
    check_drawn_as_it_is(&cube, 12, CATMARK, "do not face the same way");
}

TEST(a_triangle_without_area_is_refused)
{
    cube_bytes cube = cube_bytes_make();
    memcpy(cube.indices + 36, (uint16_t[]){0, 1, 1}, 6);
    check_drawn_as_it_is(&cube, 13, CATMARK, "triangle 12 of its primitive 0 has no area");
}

TEST(bad_extras_name_the_mesh_the_key_and_what_was_expected)
{
    static const struct {
        const char *extras, *reason;
    } cases[] = {
        {"7", "lanternfield_subdivision: scheme: expected \"catmark\" or \"loop\""},
        {"{'max_level':2}", "scheme: expected \"catmark\" or \"loop\""},
        {"{'scheme':'doo-sabin'}", "scheme: expected \"catmark\" or \"loop\""},
        {"{'scheme':'loop','max_level':0}", "max_level: expected a whole number from 1 to 5"},
        {"{'scheme':'loop','max_level':2.5}", "max_level: expected a whole number from 1 to 5"},
        {"{'scheme':'loop','max_level':'3'}", "max_level: expected a whole number from 1 to 5"},
        {"{'scheme':'loop','boundary':'none'}", "boundary: expected \"edge\" or \"edge_and_corner\""},
        {"{'scheme':'loop','creases':3}", "creases: expected a list of [vertex, vertex, sharpness]"},
        {"{'scheme':'loop','creases':[[0,1,2],[0,24,1]]}", "creases: entry 1: expected two vertices below 24"},
        {"{'scheme':'loop','creases':[[0,1,-1]]}", "a sharpness of 0 or more"},
        {"{'scheme':'loop','maxlevel':2}", "maxlevel: expected scheme, max_level, boundary or creases"},
    };
    const cube_bytes cube = cube_bytes_make();
    for (size_t i = 0; i < countof(cases); i++) {
        char extras[256];
        snprintf(extras, sizeof(extras), "{'lanternfield_subdivision':%s}", cases[i].extras);
        check_drawn_as_it_is(&cube, 12, extras, cases[i].reason);
    }
}

int main(void)
{
    scene_test_begin();
    RUN(a_cage_becomes_a_mesh_for_each_level);
    RUN(a_levels_vertices_are_where_its_stencils_say);
    RUN(vertices_on_a_seam_share_place_and_normal);
    RUN(tangents_follow_the_texture_coordinates);
    RUN(creases_are_given_by_vertices);
    RUN(triangles_of_a_loop_cage_stay_apart);
    RUN(what_is_no_quad_stays_two_triangles);
    RUN(a_non_manifold_cage_is_refused_by_name_and_drawn_as_it_is);
    RUN(faces_that_do_not_face_the_same_way_are_refused);
    RUN(a_triangle_without_area_is_refused);
    RUN(bad_extras_name_the_mesh_the_key_and_what_was_expected);
    return scene_test_end();
}
