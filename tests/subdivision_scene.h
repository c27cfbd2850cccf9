// A control cage in a glTF file: a cube of two metres whose faces have vertices, normals and texture coordinates of
// their own, as exporters write it.
#pragma once

#include "scene_test.h"

typedef struct cube_bytes {
    float positions[24][3], normals[24][3], uvs[24][2];
    uint16_t indices[3 * 14]; // 12 triangles, two a face; room for two more
    uint8_t joints[24][4]; // the lower half follows joint 0, the upper one joint 1
    float weights[24][4];
} cube_bytes;

static inline cube_bytes cube_bytes_make(void)
{
    static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    static const float uv[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    static const uint16_t halves[6] = {0, 1, 2, 0, 2, 3};
    cube_bytes cube = {0};
    for (int f = 0; f < 6; f++) {
        for (int k = 0; k < 4; k++) {
            for (int axis = 0; axis < 3; axis++) {
                cube.positions[4 * f + k][axis] = faces[f][k] >> axis & 1 ? 1.0f : -1.0f;
            }
            cube.normals[4 * f + k][f / 2] = f % 2 ? 1.0f : -1.0f;
            cube.uvs[4 * f + k][0] = uv[k][0] + 1.5f * (float)f; // nowhere continued by another face
            cube.uvs[4 * f + k][1] = uv[k][1];
            cube.joints[4 * f + k][0] = faces[f][k] >> 1 & 1;
            cube.weights[4 * f + k][0] = 1;
        }
        for (int k = 0; k < 6; k++) {
            cube.indices[6 * f + k] = (uint16_t)(4 * f + halves[k]);
        }
    }
    return cube;
}

// `extras`: of the mesh, JSON with ' for "; `rest`: further members of the file. The mesh has the first material, where
// there are any; without nodes, there is one with the mesh.
static inline scene_data *cube_load(const cube_bytes *cube, uint32_t triangles, const char *extras, const char *rest)
{
    char members[4096];
    snprintf(members, sizeof(members),
             "'bufferViews':[{'buffer':0,'byteLength':288},{'buffer':0,'byteOffset':288,'byteLength':288},"
             "{'buffer':0,'byteOffset':576,'byteLength':192},{'buffer':0,'byteOffset':768,'byteLength':84},"
             "{'buffer':0,'byteOffset':852,'byteLength':96},{'buffer':0,'byteOffset':948,'byteLength':384}],"
             "'accessors':[{'bufferView':0,'componentType':5126,'count':24,'type':'VEC3'},"
             "{'bufferView':1,'componentType':5126,'count':24,'type':'VEC3'},"
             "{'bufferView':2,'componentType':5126,'count':24,'type':'VEC2'},"
             "{'bufferView':3,'componentType':5123,'count':%u,'type':'SCALAR'},"
             "{'bufferView':4,'componentType':5121,'count':24,'type':'VEC4'},"
             "{'bufferView':5,'componentType':5126,'count':24,'type':'VEC4'}],"
             "'meshes':[{'name':'cube','primitives':[{'attributes':{'POSITION':0,'NORMAL':1,'TEXCOORD_0':2,"
             "'JOINTS_0':4,'WEIGHTS_0':5},'indices':3%s}],'extras':%s}]%s%s",
             3 * triangles, strstr(rest, "'materials'") ? ",'material':0" : "", extras,
             strstr(rest, "'nodes'") ? "" : ",'nodes':[{'mesh':0}]", rest);
    return load_members("cube.gltf", cube, sizeof(*cube), members);
}

#define CATMARK "{'lanternfield_subdivision':{'scheme':'catmark','max_level':3}}"
