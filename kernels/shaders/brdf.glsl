/* Radiance from the look-up of a table, which polar.glsl or taylor.glsl defines before it. */
const float DIVISOR = 1.0;  // C = (R / DIVISOR)^EXPONENT (1 + wi.wr)^2 / (cos(theta_i) cos(theta_r) w^2) D
const int EXPONENT = 1;
const bool SHADOWING = true;  // false: D = 1

// The reflectance, to be written after this text; its formula and numbers are in manifest.json: material.
float R(float cos_half);

// C cos(theta_i). 1 + wi.wr is |wi + wr|^2 / 2, because the sum would cancel where both directions graze.
float c_cos(vec3 wi, vec3 wr) {
    vec3 s = wi + wr;
    float one_plus_dot = 0.5 * dot(s, s), over_w = one_plus_dot / s.z;
    float reflected = R(sqrt(0.5 * one_plus_dot)) / DIVISOR;
    if (EXPONENT == 2) reflected *= reflected;
    float c = reflected * over_w * over_w / wr.z;
    return SHADOWING ? c * min(1.0, 2.0 * s.z * min(wi.z, wr.z) / one_plus_dot) : c;
}

// the colour of directions of which the table says nothing: sRGB's magenta at 1 RU, as X, Y, Z
const vec3 NOT_COMPUTED = vec3(0.5929, 0.2848, 0.9698);

// X, Y, Z of the reflected light, C cos(theta_i) value, for unit vectors towards the light and the viewer: 0 at and
// below the horizon, never negative. `computed` is false, and the colour NOT_COMPUTED, where the table has no value.
vec3 diffraction(vec3 wi, vec3 wr, out bool computed) {
    computed = true;
    if (min(wi.z, wr.z) <= 0.0) return vec3(0.0);
    vec3 value = table_value(-wi - wr, computed);
    return computed ? max(c_cos(wi, wr) * value, 0.0) : NOT_COMPUTED;
}
