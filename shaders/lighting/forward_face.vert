// Transforms vertices for the geometry shader.
#include "face_varyings.glsl"
#include <geometry_vertex.glsl>

void main() {
    transform_vertex();
}
