// The scene's vertices in world and clip space, with what materials need.
#include <geometry_vertex.glsl>

void main() {
    transform_vertex();
}
