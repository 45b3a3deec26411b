// Random numbers and low-discrepancy points.

// Mixes the bits of a number (C. Wellons, "Prospecting for Hash Functions", 2018).
uint hash(uint x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

uint hash(uint x, uint y) {
    return hash(x ^ (hash(y) + 0x9e3779b9u + (x << 6) + (x >> 2)));
}

// The upper 24 bits as a number from 0 to below 1.
float unit_float(uint bits) {
    return float(bits >> 8) * 5.9604644775390625e-8;
}

// Owen scrambling by a hash: every bit is flipped depending on the bits above it (S. Laine and T. Karras, "Stratified
// Sampling for Stochastic Transparency", 2011, with the constants of N. Vegdahl 2021).
uint owen_scramble(uint x, uint seed) {
    x = bitfieldReverse(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return bitfieldReverse(x);
}

// Point `index`, 0 to 15, of a scrambled Sobol sequence in the unit square: every 4 points that begin at a multiple of
// 4 lie in different quarters of both axes, as do 16 in sixteenths. Different seeds are independent.
vec2 sobol_point(uint index, uint seed) {
    uint i = owen_scramble(index, hash(seed)) & 15u;  // shuffled: several axes have to be independent
    uint x = bitfieldReverse(i);
    uint y = 0u;
    if ((i & 1u) != 0u) y ^= 0x80000000u;
    if ((i & 2u) != 0u) y ^= 0xc0000000u;
    if ((i & 4u) != 0u) y ^= 0xa0000000u;
    if ((i & 8u) != 0u) y ^= 0xf0000000u;
    return vec2(
        unit_float(owen_scramble(x, hash(seed + 1u))), unit_float(owen_scramble(y, hash(seed + 2u))));
}
