// The values of a generated texture at one point, and noise that repeats, for files that define `TextureSample
// texture_sample(vec2 uv)`: `uv` is 0 to 1 over one tile, u to the right and v downwards, and opposite sides must fit
// together.

struct TextureSample {
    vec3 color;       // linear base colour: the albedo of a dielectric
    float alpha;
    float height;     // in parts of the tile's width, upwards
    float roughness;  // perceptual, as in a material
    float metallic;
};

uniform int seed;

// A 32-bit random number from a cell and a number `salt`, whose words are mixed as in murmur3 (A. Appleby).
uint random_bits(ivec2 cell, int salt) {
    uint h = uint(cell.x) * 0x9e3779b1u ^ uint(cell.y) * 0x85ebca77u ^ uint(salt + 7919 * seed) * 0xc2b2ae3du;
    h = (h ^ (h >> 16u)) * 0x85ebca6bu;
    h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
    return h ^ (h >> 16u);
}

// Three random numbers from 0 to 1, from a cell and a number `salt`.
vec3 random3(ivec2 cell, int salt) {
    uint h = random_bits(cell, salt);
    return vec3(h & 0xffffu, h >> 16u, (h * 0x9e3779b1u) >> 16u) / 65536.0;
}

// The cell in the tile for a `cell` that may lie outside; `period` is the number of cells along each side of the tile.
ivec2 wrapped(ivec2 cell, ivec2 period) {
    return ivec2(cell.x - period.x * int(floor(float(cell.x) / float(period.x))),
                 cell.y - period.y * int(floor(float(cell.y) / float(period.y))));
}

// Gradient noise at `p`, about -1 to 1, that repeats after `period` cells of one unit (K. Perlin, "Improving Noise",
// 2002). Another `salt` gives another pattern.
float gradient_noise(vec2 p, ivec2 period, int salt) {
    ivec2 cell = ivec2(floor(p));
    vec2 f = p - vec2(cell);
    vec2 fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    float corners[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        uint h = random_bits(wrapped(cell + corner, period), salt);
        corners[i] = dot(vec2(h & 0xffffu, h >> 16u) / 32768.0 - 1.0, f - vec2(corner));
    }
    return 1.8 * mix(mix(corners[0], corners[1], fade.x), mix(corners[2], corners[3], fade.x), fade.y);
}

// The sum of octaves of gradient noise, about -1 to 1: `cells` of the first along u and v; each further octave has
// twice as many cells and `gain` times the height. Another `salt` gives another pattern.
float fractal_noise(vec2 uv, ivec2 cells, int octaves, float gain, int salt) {
    float sum = 0.0, weight = 1.0, total = 0.0;
    for (int i = 0; i < octaves; ++i) {
        sum += weight * gradient_noise(uv * vec2(cells), cells, salt + i);
        total += weight;
        weight *= gain;
        cells *= 2;
    }
    return sum / total;
}

struct CellularNoise {
    float nearest;  // distance to the nearest point, in cells
    ivec2 id;       // the cell of that point, for `random3`
    ivec2 home;     // the same before it is wrapped
    vec2 offset;    // from that point, in cells
};

// The position of a point relative to random points, one in each of `cells`. A `spread` of 0 puts them on a grid,
// another `salt` elsewhere (S. Worley, "A Cellular Texture Basis Function", 1996).
CellularNoise cellular_noise(vec2 uv, ivec2 cells, float spread, int salt) {
    vec2 p = uv * vec2(cells);
    ivec2 home = ivec2(floor(p));
    CellularNoise found = CellularNoise(1e9, home, home, vec2(0.0));
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            ivec2 cell = home + ivec2(i, j);
            vec2 away = p - (vec2(cell) + 0.5 + spread * (random3(wrapped(cell, cells), salt).xy - 0.5));
            if (dot(away, away) < found.nearest) {
                found = CellularNoise(dot(away, away), wrapped(cell, cells), cell, away);
            }
        }
    found.nearest = sqrt(found.nearest);
    return found;
}

// Distance to the border of the region of the nearest point, in cells (I. Quilez, "Voronoi edges", 2012). `found` is
// what `cellular_noise` returned for the same point, `cells`, `spread` and `salt`.
float cellular_edge(CellularNoise found, vec2 uv, ivec2 cells, float spread, int salt) {
    vec2 p = uv * vec2(cells);
    float edge = 1e9;
    for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i) {
            ivec2 cell = found.home + ivec2(i, j);
            vec2 away = p - (vec2(cell) + 0.5 + spread * (random3(wrapped(cell, cells), salt).xy - 0.5));
            vec2 between = found.offset - away;
            if (dot(between, between) > 1e-6)
                edge = min(edge, dot(0.5 * (found.offset + away), -normalize(between)));
        }
    return edge;
}

// A `color` made lighter or darker by the factor `exp2(by)`, and kept within the range of albedos.
vec3 shaded(vec3 color, float by) {
    return clamp(color * exp2(by), 0.0, 0.95);
}
