/* Look up a polar diffraction table, in GLSL 3.30 and later or GLSL ES 3.00 and later.
 *
 * Put `#version` before it and brdf.glsl after it. A bundle's README has both with the constants of its own table. */
precision highp float;
precision highp int;
precision highp sampler2DArray;

const int RINGS = 40;  // ring i has the radius rho = R0 sinh(i STEP)
const int AZIMUTHS = 256;
const int BAND = 16;  // rings, and
const int SECTOR = 128;  // azimuths of a tile
const int WIDTH = 128;  // columns of an image
const int EVERY[(RINGS + BAND - 1) / BAND] = int[](4, 2, 1);  // each band keeps every so many azimuths
// of band b and sector s at [b * sectors + s]: row * WIDTH + column of the tile's first texel, -1 where it is absent
const int STARTS[(RINGS + BAND - 1) / BAND * ((AZIMUTHS + SECTOR - 1) / SECTOR)] = int[](0, 32, 64, 2048, 4096, -1);
const int TEXTURES = 6;  // images
const int TERMS = 8;  // Chebyshev polynomials in |w|
const bool LOW_RANK = false;  // true: `basis` mixes outputs; false: each output is one term of one channel
const float RHO_MAX = 2.0;  // largest radius that is looked up; beyond it, nothing is known
const float R0 = 0.05;
const float STEP = 0.0318;
const float AXIS = 0.0;  // (u', v') is (u, v) turned by -AXIS, radians
const float STRETCH = 1.0;  // azimuths are evenly spaced in atan(v', STRETCH u')
const float ENVELOPE_RADIUS = 1.0;  // values are times (1 + (rho / ENVELOPE_RADIUS)^2)^-ENVELOPE_EXPONENT
const float ENVELOPE_EXPONENT = 0.0;

uniform sampler2DArray tables;  // layer q is image q, as data
uniform float scale[4 * TEXTURES];  // of output o, manifest.json: tables[o / 4].scale[o % 4]
// of output o and term k at [o * TERMS + k], manifest.json: grid.basis[o][0..2][k]
uniform vec3 basis[LOW_RANK ? 4 * TEXTURES * TERMS : 1];

// The weights of a cubic B-spline's four texels, t in [0, 1] being the place between the second and the third.
vec4 spline(float t) {
    float s = 1.0 - t;
    return vec4(s * s * s, 4.0 - 3.0 * t * t * (2.0 - t), 4.0 - 3.0 * s * s * (2.0 - s), t * t * t) / 6.0;
}

// The number of a knot's texel in an image, -1 where its tile is absent; knots are periodic.
int texel(int ring, int knot, bool opposite) {
    int band = ring / BAND, every = EVERY[band], knots = AZIMUTHS / every, in_tile = SECTOR / every;
    knot = (knot + knots + (opposite ? knots / 2 : 0)) % knots;
    int start = STARTS[band * ((AZIMUTHS + SECTOR - 1) / SECTOR) + knot / in_tile];
    return start < 0 ? -1 : start + ring % BAND * WIDTH + knot % in_tile;
}

// X, Y, Z at (u, v, w) = -wi - wr, without C cos(theta_i); `computed` is false, and all are 0, where nothing is known:
// beyond RHO_MAX, and where one of the 4 x 4 texels is in an absent tile.
vec3 table_value(vec3 uvw, out bool computed) {
    float rho = length(uvw.xy);
    computed = rho <= RHO_MAX * 1.000001;
    if (!computed) return vec3(0.0);
    vec2 turned = mat2(cos(AXIS), -sin(AXIS), sin(AXIS), cos(AXIS)) * uvw.xy;
    float place = min(asinh(rho / R0) / STEP, float(RINGS - 1));
    float turn = rho > 0.0 ? atan(turned.y, STRETCH * turned.x) / 6.28318531 : 0.0;
    float azimuth = fract(turn) * float(AZIMUTHS);
    vec4 across = spline(fract(place)), found[TEXTURES];
    for (int q = 0; q < TEXTURES; ++q) found[q] = vec4(0.0);
    for (int a = 0; a < 4; ++a) {
        // below the first ring, which is one point, half a turn on; mirrored at the last
        int row = int(place) - 1 + a, ring = RINGS - 1 - abs(RINGS - 1 - abs(row));
        float knot = azimuth / float(EVERY[ring / BAND]);
        vec4 along = spline(fract(knot));
        for (int b = 0; b < 4; ++b) {
            int at = texel(ring, int(knot) - 1 + b, row < 0);
            if (at < 0) {
                computed = false;
                return vec3(0.0);
            }
            for (int q = 0; q < TEXTURES; ++q)
                found[q] += across[a] * along[b] * texelFetch(tables, ivec3(at % WIDTH, at / WIDTH, q), 0);
        }
    }
    float w_max = sqrt(max(4.0 - rho * rho, 1e-6));
    float x = clamp(2.0 * abs(uvw.z) / w_max - 1.0, -1.0, 1.0), T[TERMS];
    T[0] = 1.0;                         // Chebyshev polynomials in |w|
    T[1] = x;
    for (int k = 2; k < TERMS; ++k) T[k] = 2.0 * x * T[k - 1] - T[k - 2];
    vec3 value = vec3(0.0);
    for (int o = 0; o < 4 * TEXTURES; ++o) {
        vec3 shape = vec3(0.0);         // what output o is worth in X, Y and Z at this |w|
        if (LOW_RANK)
            for (int k = 0; k < TERMS; ++k) shape += T[k] * basis[o * TERMS + k];
        else
            shape[o / TERMS] = T[o % TERMS];
        value += scale[o] * found[o / 4][o % 4] * shape;
    }
    return value * pow(1.0 + rho * rho / (ENVELOPE_RADIUS * ENVELOPE_RADIUS), -ENVELOPE_EXPONENT);
}
