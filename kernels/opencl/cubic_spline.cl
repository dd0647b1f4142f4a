/* Cubic B-splines through the samples of a polar table, and their look-up.
 *
 * Coefficients come from samples by the filter sqrt(3) z^|k|, z = sqrt(3) - 2 (Unser 1993), once along each axis; the
 * spline through (..., c_(i-1), c_i, c_(i+1), c_(i+2), ...) has the four weights of `spline`. Between samples that is
 * half the error of Catmull-Rom, and its weights are positive: four bilinear fetches make one bicubic.
 *
 * Rings go on below the first, which is one point, as the opposite half turn: (-i, a) = (i, a + azimuths / 2);
 * beyond the last they are mirrored. Azimuths are periodic.
 *
 * filter_rings: coefficients across the rings, in place; one work-item, LANES azimuths of half a turn and those
 * opposite, one output. filter_azimuths: around the turn, in place; one work-item, one output and ring. A ring may have
 * its knots at every second or fourth azimuth: the spline goes through its samples there, and knots are inserted between
 * them, c_(2j) = (c_(j-1) + 6 c_j + c_(j+1)) / 8, c_(2j+1) = (c_j + c_(j+1)) / 2, which leaves it as it is. look_up:
 * values between samples; one work-item, one direction. Arguments:
 *
 * filter_rings
 *   table     float[rings][outputs][azimuths]   1   samples, then coefficients across; azimuths is a multiple of 2 LANES
 *   rings     int                               1   of the table
 *
 * filter_azimuths
 *   table     float[rings][outputs][azimuths]   1   coefficients across the rings, then of both axes
 *   azimuths  int                               1   of a ring
 *   every     int[rings]                        1   azimuths from knot to knot: 1, 2 or 4
 *
 * look_up
 *   table     float[rings][CHANNELS][w_terms][azimuths]   1   coefficients
 *   rings     int                               1   of the table
 *   azimuths  int                               1   of a ring
 *   w_terms   int                               1   Chebyshev terms in |w|
 *   cell      int2[directions]                  1   the ring and the azimuth below a direction
 *   place     float4[directions]                1   the fractions beyond them; 2 |w| / w_max - 1; fourth unused
 *   value     float4[directions]                1   result: X, Y, Z = sum_k T_k table[k]; fourth unused
 *
 * Set by the host: LANES, 16.
 */

#include "common.cl"
#define Z (-0.26794919f)  /* the filter's pole, sqrt(3) - 2 */
#define Z2 (Z * Z)
#define Z4 (Z2 * Z2)
#define Z8 (Z4 * Z4)
#define BLOCK 16  /* vectors of a row that wait in the nearest cache */
#define RINGS 32  /* of a column that wait there */
#define AHEAD 16  /* steps after which a recursion has forgotten where it began: z^16 = 7e-10 */
#define GAIN 6.0f /* both recursions make -z / (1 - z^2) z^|k|, and 6 of it are sqrt(3) z^|k| */
#define TAPS 4    /* of a cubic spline, along each axis */

/* One factor of sum_k z^|k| d^k, d a step along the row. That sum is 1 - z^2 times the product over n = 1, 2, 4, ... of
 * (1 + z^n d^n) (1 + z^n d^-n) = (1 + z^2n) (1 + q (d^n + d^-n)), q = z^n / (1 + z^2n); what n = 16 adds is 7e-10. */
#define FACTOR(name, before, after, zn)                                                                                \
    static void name(float16 *line, const int vectors) {                                                               \
        const float q = zn / (1.0f + zn * zn);                                                                         \
        float16 a = 0.0f, x = line[0];                                                                                 \
        ROLLED for (int i = 0; i < vectors; ++i) {                                                                     \
            const float16 b = i + 1 < vectors ? line[i + 1] : (float16)0.0f;                                           \
            line[i] = fma((float16)q, before + after, x);                                                              \
            a = x;                                                                                                     \
            x = b;                                                                                                     \
        }                                                                                                              \
    }
FACTOR(factor_1, (float16)(a.sf, x.s01234567, x.s89ab, x.scd, x.se),
       (float16)(x.s1, x.s23, x.s4567, x.s89abcdef, b.s0), Z)
FACTOR(factor_2, (float16)(a.sef, x.s01234567, x.s89ab, x.scd), (float16)(x.s23, x.s4567, x.s89abcdef, b.s01), Z2)
FACTOR(factor_4, (float16)(a.scdef, x.s01234567, x.s89ab), (float16)(x.s4567, x.s89abcdef, b.s0123), Z4)
FACTOR(factor_8, (float16)(a.hi, x.lo), (float16)(x.hi, b.lo), Z8)

/* Every second number of a row, the first of them kept, in its first half. */
static void halve(__global float *row, const int vectors) {
    ROLLED for (int i = 0; i < vectors / 2; ++i)
        vstore16((float16)(vload16(2 * i, row).even, vload16(2 * i + 1, row).even), i, row);
}

/* Knots between those of a row's first `vectors`, in twice as many; from the last on, so that none is overwritten. */
static void insert_knots(__global float *row, const int vectors) {
    float16 x = vload16(vectors - 1, row), after = vload16(0, row);
    const float16 last = x;
    ROLLED for (int i = vectors - 1; i >= 0; --i) {
        const float16 before = i > 0 ? vload16(i - 1, row) : last;
        const float16 left = (float16)(before.sf, x.s01234567, x.s89ab, x.scd, x.se);
        const float16 right = (float16)(x.s1, x.s23, x.s4567, x.s89abcdef, after.s0);
        const float16 even = 0.125f * (left + right) + 0.75f * x, odd = 0.5f * (x + right);
        float16 low, high;
        low.even = even.lo;
        low.odd = odd.lo;
        high.even = even.hi;
        high.odd = odd.hi;
        vstore16(low, 2 * i, row);
        vstore16(high, 2 * i + 1, row);
        after = x;
        x = before;
    }
}

/* A row, BLOCK vectors at a time with one on either side, whose 15 nearest lanes suffice. */
__kernel void filter_azimuths(__global float *table, const int azimuths, __global const int *every) {
    __global float *row = table + (long)(get_global_id(1) * get_global_size(0) + get_global_id(0)) * azimuths;
    const int all = azimuths / LANES, vectors = all / every[get_global_id(1)];
    ROLLED for (int left = all; left > vectors; left /= 2) halve(row, left);
    const float gain = sqrt(3.0f) * (1.0f - Z2) * (1.0f + Z2) * (1.0f + Z4) * (1.0f + Z8) * (1.0f + Z8 * Z8);
    const float16 first = vload16(0, row);
    float16 before = vload16(vectors - 1, row), line[BLOCK + 2];
    ROLLED for (int from = 0; from < vectors; from += BLOCK) {
        const int count = min(BLOCK, vectors - from);
        line[0] = before;
        ROLLED for (int i = 0; i < count; ++i) line[i + 1] = vload16(from + i, row);
        line[count + 1] = from + count < vectors ? vload16(from + count, row) : first;
        before = line[count];
        factor_8(line, count + 2);
        factor_4(line, count + 2);
        factor_2(line, count + 2);
        factor_1(line, count + 2);
        ROLLED for (int i = 0; i < count; ++i) vstore16(gain * line[i + 1], from + i, row);
    }
    ROLLED for (int made = vectors; made < all; made *= 2) insert_knots(row, made);
}

/* A ring beyond either end: its place in the table, and whether it is half a turn on. */
static int ring_of(int ring, const int rings, int *opposite) {
    *opposite = ring < 0;
    ring = abs(ring);
    return clamp(ring < rings ? ring : 2 * (rings - 1) - ring, 0, rings - 1);
}

/* A recursion outwards and one back, over RINGS at a time; the one back begins AHEAD of them. */
__kernel void filter_rings(__global float *table, const int rings) {
    const int tile = get_global_id(0), tiles = get_global_size(0);
    const int output = get_global_id(1), outputs = get_global_size(1);
    /* vectors from ring to ring */
    const long ring = (long)HALVES * outputs * tiles;
    __global float *here = table + (HALVES * output * tiles + tile) * LANES, *there = here + tiles * LANES;

    float16 a = 0.0f, b = 0.0f;
    ROLLED for (int i = -AHEAD; i < 0; ++i) {
        int opposite;
        const long row = ring * ring_of(i, rings, &opposite);
        a = fma((float16)Z, a, vload16(row, there));
        b = fma((float16)Z, b, vload16(row, here));
    }
    ROLLED for (int from = 0; from < rings; from += RINGS) {
        const int count = min(RINGS, rings - from), seen = min(RINGS + AHEAD, rings - from);
        float16 out[RINGS + AHEAD + 1][HALVES];
        out[0][0] = a;
        out[0][1] = b;
        ROLLED for (int i = 0; i < seen; ++i) {
            out[i + 1][0] = fma((float16)Z, out[i][0], vload16(ring * (from + i), here));
            out[i + 1][1] = fma((float16)Z, out[i][1], vload16(ring * (from + i), there));
        }
        /* the last is mirrored: c_n = (z out_(n-2) + z^2 out_(n-1)) / (z^2 - 1); elsewhere AHEAD forgets what c_n is */
        float16 a_back = 0.0f, b_back = 0.0f;
        if (from + seen == rings) {
            a_back = (Z * out[seen - 1][0] + Z2 * out[seen][0]) / (Z2 - 1.0f);
            b_back = (Z * out[seen - 1][1] + Z2 * out[seen][1]) / (Z2 - 1.0f);
        }
        ROLLED for (int i = seen - 1; i >= 0; --i) {
            a_back = Z * (a_back - out[i + 1][0]);
            b_back = Z * (b_back - out[i + 1][1]);
            if (i < count) {
                vstore16(GAIN * a_back, ring * (from + i), here);
                vstore16(GAIN * b_back, ring * (from + i), there);
            }
        }
        a = out[count][0];
        b = out[count][1];
    }
}

/* Weights of the four samples about a place, t beyond the second. */
static float4 spline(const float t) {
    const float u = 1.0f - t;
    return (float4)(u * u * u, 4.0f - 3.0f * t * t * (2.0f - t), 4.0f - 3.0f * u * u * (2.0f - u), t * t * t) / 6.0f;
}

/* A table's value between samples: those about it, by their places in one output, and their weights. */
static float between(__global const float *output, const long *place, const float *weight) {
    float sum = 0.0f;
    UNROLL for (int tap = 0; tap < TAPS * TAPS; ++tap) sum = fma(weight[tap], output[place[tap]], sum);
    return sum;
}

__kernel void look_up(__global const float *table, const int rings, const int azimuths, const int w_terms,
                      __global const int2 *cell, __global const float4 *place, __global float4 *value) {
    const int2 below = cell[get_global_id(0)];
    const float4 at = place[get_global_id(0)];
    const float4 across = spline(at.x), along = spline(at.y);
    long taken[TAPS * TAPS];
    float weight[TAPS * TAPS];
    ROLLED for (int i = 0; i < TAPS; ++i) {
        int opposite;
        const long ring = ring_of(below.x - 1 + i, rings, &opposite);
        const int first = below.y - 1 + (opposite ? azimuths / 2 : 0) + azimuths;
        ROLLED for (int j = 0; j < TAPS; ++j) {
            taken[TAPS * i + j] = ring * CHANNELS * w_terms * azimuths + (first + j) % azimuths;
            weight[TAPS * i + j] = ((const float *)&across)[i] * ((const float *)&along)[j];
        }
    }
    float xyz[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    ROLLED for (int c = 0; c < CHANNELS; ++c) {
        /* Clenshaw's recurrence */
        __global const float *channel = table + (long)c * w_terms * azimuths;
        float b1 = 0.0f, b2 = 0.0f;
        ROLLED for (int k = w_terms - 1; k >= 0; --k) {
            const float x = k > 0 ? 2.0f * at.z : at.z;
            const float b = x * b1 - b2 + between(channel + (long)k * azimuths, taken, weight);
            b2 = b1;
            b1 = b;
        }
        xyz[c] = b1;
    }
    value[get_global_id(0)] = vload4(0, xyz);
}
