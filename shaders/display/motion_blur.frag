// Gathers the surfaces that pass over a pixel during the exposure.
// M. McGuire, P. Hennessy, M. Bukowski and B. Osman, "A Reconstruction Filter for Plausible Motion Blur", 2012;
// J.-P. Guertin, M. McGuire and D. Nowrouzezahrai, "A Fast and Stable Feature-Aware Motion Blur Filter", 2014.
#include <noise.glsl>

uniform sampler2D sharp;
uniform sampler2D motion;  // xy half the motion in pixels, z the distance, w the length of xy
uniform sampler2D neighborhood;
uniform int samples;
uniform float jitter;
uniform float depth_tolerance;
out vec4 radiance;

ivec2 clamped(vec2 position) {
    return clamp(ivec2(floor(position)), ivec2(0), textureSize(sharp, 0) - 1);
}

// 1 where a distance `z` is nearer than an `other` by the tolerance, 0 where it is not nearer.
float nearness(float z, float other) {
    return clamp((other - z) / (depth_tolerance * max(min(z, other), 1e-4)), 0.0, 1.0);
}

// Whether a motion reaches a distance, with a soft edge of half a pixel.
float reaches(float speed, float distance) {
    return clamp(speed - distance + 0.5, 0.0, 1.0);
}

float cone(float speed, float distance) {
    return clamp(1.0 - distance / max(speed, 1e-4), 0.0, 1.0);
}

float cylinder(float speed, float distance) {
    return 1.0 - smoothstep(0.95 * speed, 1.05 * speed, distance);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 center = texelFetch(sharp, texel, 0), own = texelFetch(motion, texel, 0);
    vec2 fastest = texelFetch(neighborhood, texel / REACH, 0).xy;
    float speed = length(fastest);
    if (speed < 0.5) {
        radiance = center;
        return;
    }
    float shift = jitter * (interleaved_gradient_noise(gl_FragCoord.xy) - 0.5);
#if WEIGHTS == WEIGHTS_CONES
    float total = 1.0 / max(own.w, 0.5);
    vec4 sum = center * total;
    for (int i = 0; i < samples; ++i) {
        float t = (float(i) + 0.5 + shift) / float(samples) * 2.0 - 1.0;
        vec2 offset = fastest * t;
        ivec2 at = clamped(gl_FragCoord.xy + offset);
        vec4 other = texelFetch(motion, at, 0);
        float distance = length(offset), other_speed = max(other.w, 0.5), own_speed = max(own.w, 0.5);
        float weight = (1.0 - nearness(own.z, other.z)) * cone(other_speed, distance)
            + (1.0 - nearness(other.z, own.z)) * cone(own_speed, distance)
            + 2.0 * cylinder(other_speed, distance) * cylinder(own_speed, distance);
        total += weight;
        sum += weight * texelFetch(sharp, at, 0);
    }
    radiance = sum / total;
#else
    // Surfaces that pass in front: samples along the fastest motion, each of which covers the pixel while its own
    // motion takes it there. `covered` is their share of the exposure.
    vec4 front = vec4(0.0), behind = vec4(0.0);
    float covered = 0.0;
    for (int i = 0; i < samples; ++i) {
        float t = (float(i) + 0.5 + shift) / float(samples) * 2.0 - 1.0;
        ivec2 at = clamped(gl_FragCoord.xy + fastest * t);
        vec4 other = texelFetch(motion, at, 0);
        float weight = nearness(other.z, own.z) * reaches(other.w, speed * abs(t)) * speed / max(other.w, 0.5);
        covered += weight;
        front += weight * texelFetch(sharp, at, 0);

        // The pixel's own surface as it moves past, and the background that it uncovers; nearer surfaces are counted
        // above.
        at = clamped(gl_FragCoord.xy + own.xy * t);
        float is_nearer = nearness(texelFetch(motion, at, 0).z, own.z);
        behind += mix(texelFetch(sharp, at, 0), center, is_nearer);
    }
    front /= max(covered, 1e-4);
    radiance = mix(behind / float(samples), front, min(covered / float(samples), 1.0));
#endif
}
