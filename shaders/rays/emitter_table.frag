// The power of each emitting triangle in w, for choosing one, up to a common factor: area times the luminance of its
// emission without texture. xyz hold the triangle's centre times this power.
#include <luminance.glsl>
#include <scene.glsl>
out vec4 emitter_table;

void main() {
    emitter_table = vec4(0.0);
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int number = texel.y * EMITTER_TABLE_SIDE + texel.x;
    if (number >= SCENE_EMITTER_COUNT) return;
    SceneEmitter emitter = scene_emitters[number];
    mat3 corners = scene_corners(emitter.instance, emitter.triangle);
    float area = 0.5 * length(cross(corners[1] - corners[0], corners[2] - corners[0]));
    int material = MATERIAL_INDEX(scene_instance(emitter.instance).material);
    float power = area * luminance_of(materials[material].emissive.rgb);
    emitter_table = vec4((corners * vec3(1.0 / 3.0)) * power, power);
}
