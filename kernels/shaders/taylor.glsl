/* Look up the diffraction tables I_p of Dhillon et al. 2014, in GLSL 3.30 and later or GLSL ES 3.00 and later.
 *
 * Put `#version` before it and brdf.glsl after it. A bundle's README has both with the constants of its own tables. The
 * sum cancels: keep it in float32, never in half. */
precision highp float;
precision highp int;
precision highp sampler2DArray;

const int POWERS = 51;  // images: p = 0 ... POWERS - 1
const float N = 501.0;  // texels of an image along u and v
const float A = 5.0;  // exponent of the grid: u = 2 |t|^A sign(t)

uniform sampler2DArray I;  // layer p holds I_p / scale[p], as data, bilinear, clamped to the edge
uniform float scale[POWERS];  // manifest.json: tables[p].scale

// The texture coordinate of u (or v) in [-2, 2]: texel i of N stands at t = 2 i / (N - 1) - 1.
float coordinate(float u) {
    float t = sign(u) * pow(0.5 * abs(u), 1.0 / A);
    return (0.5 * (t + 1.0) * (N - 1.0) + 0.5) / N;
}

// X, Y, Z at (u, v, w) = -wi - wr, without C cos(theta_i); `computed` is false, and all are 0, where nothing is known.
vec3 table_value(vec3 uvw, out bool computed) {
    vec2 at = vec2(coordinate(uvw.x), coordinate(uvw.y));
    computed = texture(I, vec3(at, 0)).a >= 0.9999;
    if (!computed) return vec3(0.0);
    vec3 sum = vec3(0.0);
    for (int p = POWERS - 1; p >= 0; --p)       // Horner's rule
        sum = sum * uvw.z + scale[p] * texture(I, vec3(at, p)).rgb;
    return sum;
}
