// Transforms the scene's vertices and passes on everything that materials need.
#include <geometry_vertex.glsl>

void main() {
    transform_vertex();
}
