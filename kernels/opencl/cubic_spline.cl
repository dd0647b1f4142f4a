/* Cubic B-splines through the samples of a polar table, and their look-up.
 *
 * Coefficients come from samples by the filter sqrt(3) z^|k|, z = sqrt(3) - 2, cut at 2e-7 (Unser 1993);
 * the spline through (..., c_(i-1), c_i, c_(i+1), c_(i+2), ...) has the four weights of `spline`. Between samples that is half
 * the error of Catmull-Rom, and its weights are positive: four bilinear fetches make one bicubic.
 *
 *   table   float[rings][OUT][azimuths]     outputs of the spectral operator; azimuths is a multiple of 32
 *
 * Rings go on below the first, which is one point, as the opposite half turn: (-i, a) = (i, a + azimuths / 2); beyond the
 * last they are mirrored. Azimuths are periodic. Set by the host: OUT = 3 W_TERMS outputs of a look-up; RINGS that
 * one work-item filters.
 */

#define TAIL 12
#define BLOCK 256
#define UNROLL _Pragma("unroll")

/* sqrt(3) z^k */
__constant float weight_of[TAIL + 1] = {1.7320508e+00f, -4.6410162e-01f, 1.2435565e-01f, -3.3320996e-02f, 8.9283340e-03f,
                                        -2.3923399e-03f, 6.4102553e-04f, -1.7176227e-04f, 4.6023562e-05f, -1.2331976e-05f,
                                        3.3043430e-06f, -8.8539606e-07f, 2.3724117e-07f};

/* Around the turn. One work-item, one ring and output; lines of BLOCK azimuths with their neighbours on either side. */
__kernel void filter_azimuths(__global const float *in, const int azimuths, __global float *out) {
    const long row = (long)(get_global_id(1) * get_global_size(0) + get_global_id(0)) * azimuths;
    for (int from = 0; from < azimuths; from += BLOCK) {
        const int to = min(from + BLOCK, azimuths);
        float line[BLOCK + 32];
        for (int i = from - 16; i < to + 16; i += 16)
            vstore16(vload16(0, in + row + (i + azimuths) % azimuths), 0, line + i - from + 16);
        for (int i = from; i < to; i += 16) {
            const float *at = line + i - from + 16;
            float16 sum = weight_of[0] * vload16(0, at);
            UNROLL for (int k = 1; k <= TAIL; ++k) sum += weight_of[k] * (vload16(0, at - k) + vload16(0, at + k));
            vstore16(sum, 0, out + row + i);
        }
    }
}

/* a ring beyond either end: its place in the table, and whether it is half a turn on */
static int ring_of(int ring, const int rings, int *opposite) {
    *opposite = ring < 0;
    ring = abs(ring);
    return clamp(ring < rings ? ring : 2 * (rings - 1) - ring, 0, rings - 1);
}

/* Across the rings. One work-item, sixteen azimuths of one output, RINGS rings with their neighbours on either side. */
__kernel void filter_rings(__global const float *in, const int rings, __global float *out) {
    const int tile = get_global_id(0), tiles = get_global_size(0), output = get_global_id(2), outputs = get_global_size(2);
    const int from = RINGS * get_global_id(1), to = min(from + RINGS, rings);
    float16 column[RINGS + 2 * TAIL];
    for (int i = from - TAIL; i < to + TAIL; ++i) {
        int opposite;
        const long row = (long)ring_of(i, rings, &opposite) * outputs + output;
        column[i - from + TAIL] = vload16(row * tiles + (opposite ? (tile + tiles / 2) % tiles : tile), in);
    }
    for (int i = from; i < to; ++i) {
        const float16 *at = column + i - from + TAIL;
        float16 sum = weight_of[0] * at[0];
        UNROLL for (int k = 1; k <= TAIL; ++k) sum += weight_of[k] * (at[-k] + at[k]);
        vstore16(sum, ((long)i * outputs + output) * tiles + tile, out);
    }
}

static float4 spline(const float t) {
    const float u = 1.0f - t;
    return (float4)(u * u * u, 4.0f - 3.0f * t * t * (2.0f - t), 4.0f - 3.0f * u * u * (2.0f - u), t * t * t) / 6.0f;
}

/* Values at places between the samples.
 *
 *   cell    int2[directions]        the ring and the azimuth below a place
 *   place   float4[directions]      the fractions beyond them; 2 |w| / w_max - 1; fourth unused
 *   value   float4[directions]      X, Y, Z: sum_k T_k table[k]; fourth unused
 *
 * One work-item, one direction.
 */
__kernel void look_up(__global const float *table, const int rings, const int azimuths, __global const int2 *cell,
                      __global const float4 *place, __global float4 *value) {
    const int2 below = cell[get_global_id(0)];
    const float4 at = place[get_global_id(0)];
    const float4 across = spline(at.x), along = spline(at.y);
    float sum[OUT];
    for (int o = 0; o < OUT; ++o) sum[o] = 0.0f;
    for (int i = 0; i < 4; ++i) {
        int opposite;
        const int ring = ring_of(below.x - 1 + i, rings, &opposite);
        const int first = below.y - 1 + (opposite ? azimuths / 2 : 0) + azimuths;
        const int4 a = (first + (int4)(0, 1, 2, 3)) % azimuths;
        const float4 weight = ((const float *)&across)[i] * along;
        for (int o = 0; o < OUT; ++o) {
            __global const float *row = table + (long)(ring * OUT + o) * azimuths;
            sum[o] += dot(weight, (float4)(row[a.x], row[a.y], row[a.z], row[a.w]));
        }
    }
    float xyz[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int c = 0; c < 3; ++c) {
        /* Clenshaw's recurrence */
        float b1 = 0.0f, b2 = 0.0f;
        for (int k = W_TERMS - 1; k > 0; --k) {
            const float b = 2.0f * at.z * b1 - b2 + sum[c * W_TERMS + k];
            b2 = b1;
            b1 = b;
        }
        xyz[c] = at.z * b1 - b2 + sum[c * W_TERMS];
    }
    value[get_global_id(0)] = vload4(0, xyz);
}
