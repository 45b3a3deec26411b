// Vertices on their way to the geometry shader.
#include "face_names.glsl"
#include <geometry_vertex.glsl>

void main() {
    transform_vertex();
}
