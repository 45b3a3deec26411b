// Luminance of the environment times the solid angle of a texel, for choosing directions. rendergraph provides
// `light_from()`.
#include <luminance.glsl>
#include "environment_directions.glsl"
out float environment_table;

void main() {
    vec2 size = ENVIRONMENT_TABLE_SIZE;
    vec2 uv = gl_FragCoord.xy / size;
    environment_table = max(luminance_of(light_from(table_direction(uv), -PI / size.y)), 0.0) * sin(PI * uv.y);
}
