// Edges of a finished picture: where brightness differs from the pixel's on the left, and from the one below. One that
// stands beside a much stronger one is none: it is that one's blur.
uniform sampler2D source;
uniform float threshold;
uniform float dominance;
out vec2 edges;  // 1 on the left, below

float bright_at(ivec2 texel) {
    texel = clamp(texel, ivec2(0), textureSize(source, 0) - 1);
    return dot(texelFetch(source, texel, 0).rgb, vec3(0.2126, 0.7152, 0.0722));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float here = bright_at(texel);
    float left = bright_at(texel - ivec2(1, 0)), below = bright_at(texel - ivec2(0, 1));
    vec2 step_here = abs(here - vec2(left, below));
    vec2 beyond = abs(vec2(left - bright_at(texel - ivec2(2, 0)), below - bright_at(texel - ivec2(0, 2))));
    vec2 behind = abs(here - vec2(bright_at(texel + ivec2(1, 0)), bright_at(texel + ivec2(0, 1))));
    vec2 around = max(max(beyond, behind), step_here.yx);
    edges = step(threshold, step_here) * step(max(around.x, around.y), dominance * step_here);
}
