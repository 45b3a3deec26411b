// Lighting once per face: at its centroid, with the normal of its plane.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

#include "vertex_light.glsl"
#define DIRECTION out
#include "vertex_light_varyings.glsl"

in vec3 g_position[];
#if PASS_SAMPLES > 1
centroid in vec4 g_centroid_position[];
centroid out vec4 v_centroid_position;
#endif
centroid in vec3 g_normal[];
flat in int g_material[];
flat in int g_object[];
out vec3 v_position;
centroid out vec3 v_normal;
flat out int v_material;
flat out int v_object;
#ifdef HAS_UV0
centroid in vec2 g_uv0[];
centroid out vec2 v_uv0;
#endif
#ifdef HAS_UV1
centroid in vec2 g_uv1[];
centroid out vec2 v_uv1;
#endif
#ifdef HAS_TANGENT
centroid in vec4 g_tangent[];
centroid out vec4 v_tangent;
#endif
#ifdef HAS_VERTEX_COLOR
centroid in vec4 g_color[];
centroid out vec4 v_color;
#endif

void main() {
    vec3 face_normal = cross(g_position[1] - g_position[0], g_position[2] - g_position[0]);
    vec3 normal = face_normal * inversesqrt(max(dot(face_normal, face_normal), 1e-37));
    if (dot(normal, g_normal[0] + g_normal[1] + g_normal[2]) < 0.0) normal = -normal;  // a mirrored object
    vec3 center = (g_position[0] + g_position[1] + g_position[2]) / 3.0;
    VertexLight light = vertex_light(g_material[0], center, normal);
    for (int i = 0; i < 3; ++i) {
        v_diffuse = light.unshadowed.diffuse;
        v_specular = light.unshadowed.specular;
#ifdef HAS_ENVIRONMENT
        v_environment_diffuse = light.environment.diffuse;
        v_environment_specular = light.environment.specular;
#endif
#if SHADOW_LIGHT_COUNT > 0
        for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
            v_shadowed_diffuse[k] = light.shadowed[k].diffuse;
            v_shadowed_specular[k] = light.shadowed[k].specular;
        }
#endif
        v_position = g_position[i];
#if PASS_SAMPLES > 1
        v_centroid_position = g_centroid_position[i];
#endif
        v_normal = g_normal[i];
        v_material = g_material[i];
        v_object = g_object[i];
#ifdef HAS_UV0
        v_uv0 = g_uv0[i];
#endif
#ifdef HAS_UV1
        v_uv1 = g_uv1[i];
#endif
#ifdef HAS_TANGENT
        v_tangent = g_tangent[i];
#endif
#ifdef HAS_VERTEX_COLOR
        v_color = g_color[i];
#endif
        gl_Position = gl_in[i].gl_Position;
        EmitVertex();
    }
    EndPrimitive();
}
