/* Look up a polar diffraction table, in GLSL 3.30 and later or GLSL ES 3.00 and later.
 *
 * Put `#version` before it and brdf.glsl after it. A bundle's README has both with the constants of its own table. */
precision highp float;
precision highp int;
precision highp sampler2DArray;

const int RINGS = 139;  // rows of an image: ring i has the radius rho = R0 sinh(i STEP)
const int AZIMUTHS = 640;  // columns of an image
const int TEXTURES = 6;  // images
const int TERMS = 8;  // Chebyshev polynomials in |w|
const bool LOW_RANK = false;  // true: `basis` mixes outputs; false: each output is one term of one channel
const float RHO_MAX = 2.0;  // of the last ring; beyond it, nothing was computed
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

// The texel of any ring and azimuth: the first ring is one point, the last one mirrors, azimuths are periodic.
ivec2 texel(int ring, int azimuth) {
    if (ring < 0) {
        ring = -ring;
        azimuth += AZIMUTHS / 2;
    }
    if (ring > RINGS - 1) ring = 2 * (RINGS - 1) - ring;
    return ivec2((azimuth + AZIMUTHS) % AZIMUTHS, ring);
}

// X, Y, Z at (u, v, w) = -wi - wr, without C cos(theta_i); 0 where nothing was computed.
vec3 table_value(vec3 uvw) {
    float rho = length(uvw.xy);
    if (rho > RHO_MAX * 1.000001) return vec3(0.0);
    vec2 turned = mat2(cos(AXIS), -sin(AXIS), sin(AXIS), cos(AXIS)) * uvw.xy;
    float ring = min(asinh(rho / R0) / STEP, float(RINGS - 1));
    float turn = rho > 0.0 ? atan(turned.y, STRETCH * turned.x) / 6.28318531 : 0.0;
    float azimuth = fract(turn) * float(AZIMUTHS);
    vec4 across = spline(fract(ring)), along = spline(fract(azimuth)), found[TEXTURES];
    for (int q = 0; q < TEXTURES; ++q) {
        found[q] = vec4(0.0);
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b) {
                ivec2 at = texel(int(ring) - 1 + a, int(azimuth) - 1 + b);
                found[q] += across[a] * along[b] * texelFetch(tables, ivec3(at, q), 0);
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
