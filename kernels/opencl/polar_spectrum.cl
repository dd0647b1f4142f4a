/* Power spectrum E(r, phi, s) = |P(r (cos phi, sin phi); s)|^2 on a polar grid, from the Chebyshev stack.
 *
 *   P(f; s) = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f),  s = k w          (Jacobi-Anger; F_n as in eq. 8 of
 *                                                                          Dhillon et al. 2014, of T_n(h/H))
 *
 * With A the sum over even n and i B that over odd n, P(f) = A + i B; heights are real, so F_n(-f) is the conjugate
 * and |P(-f)| = |A - i B|: both half turns come from one gather.
 *
 *   stack    float[rows][columns][2][16 * BLOCKS]    F_n: real and imaginary parts, terms side by side
 *   decay    float[2 * REACH_X + 1], then [2 * REACH_Y + 1]   the window's transform at j spacings from its peak
 *   radius   double[radii]                           r, 1/um
 *   azimuth  double[tiles][2][16]                    cos phi, then sin phi, of half a turn
 *   series   float[16 * BLOCKS][16 * S_BLOCKS]       (-1)^floor(n/2) (2 - [n = 0]) J_n(s H), zero beyond the last term
 *   spectrum float[2 * tiles][radii][S_NODES][16]    E: the tiles of the half turn, then those half a turn on;
 *                                                    azimuths of a tile side by side
 *   fx_max, fy_max                                   the scan's band, 1/um: beyond it nothing is known and E = 0
 *
 * Sums are float: T_n and J_n are bounded by 1, nothing cancels. Positions are double: f / df has 4 digits before
 * the point. One work-item, one radius and the sixteen azimuths of a tile.
 *
 * Set by the host: BLOCKS of 16 terms, S_NODES and S_BLOCKS of 16 of them, REACH_X and REACH_Y.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")
#define TAPS_X (2 * REACH_X + 1)
#define TAPS_Y (2 * REACH_Y + 1)
#define CELL (32 * BLOCKS)

typedef struct {
    double dfx, dfy;            /* spacing of the DFT's frequencies, 1/um */
    double inverse_2_variance;  /* 1 / (2 sigma_f^2), um^2 */
    int columns, row_zero, column_zero;
} Grid;

/* exp(-(d - j df)^2 / (2 sigma_f^2)), j = -reach .. reach, of sixteen azimuths at once: weight[tap] holds a tap's.
 * One pair of exponentials, then products with `decay`. */
static void window_weights(const float16 d, const float df, const float inverse, __global const float *decay,
                           const int reach, float16 *weight) {
    const float16 peak = exp(-d * d * inverse), ratio = exp(2.0f * df * inverse * d), back = 1.0f / ratio;
    float16 up = peak, down = peak;
    weight[reach] = peak;
    for (int j = 1; j <= reach; ++j) {
        up *= ratio;
        down *= back;
        weight[reach + j] = up * decay[reach + j];
        weight[reach - j] = down * decay[reach - j];
    }
}

/* F_n(f) for all n: four chains of sums for each part hide the latency of the additions */
static void gather(__global const float *corner, const int columns, const float *along_x, const float *along_y,
                   float *re, float *im) {
    for (int b = 0; b < BLOCKS; ++b) {
        float16 sum_re[4] = {0.0f, 0.0f, 0.0f, 0.0f}, sum_im[4] = {0.0f, 0.0f, 0.0f, 0.0f};
        /* written out as well, a wide window's taps would take the compiler minutes */
        _Pragma("nounroll") for (int t = 0; t < TAPS_Y; ++t) {
            __global const float *cell = corner + (long)t * columns * CELL + 16 * b;
            const float row = along_y[16 * t];
            UNROLL for (int s = 0; s < TAPS_X; ++s) {
                const float16 weight = along_x[16 * s] * row;
                sum_re[s & 3] = fma(weight, vload16(0, cell + s * CELL), sum_re[s & 3]);
                sum_im[s & 3] = fma(weight, vload16(0, cell + s * CELL + 16 * BLOCKS), sum_im[s & 3]);
            }
        }
        vstore16((sum_re[0] + sum_re[1]) + (sum_re[2] + sum_re[3]), b, re);
        vstore16((sum_im[0] + sum_im[1]) + (sum_im[2] + sum_im[3]), b, im);
    }
}

/* rows and columns of sixteen vectors change places: halves, quarters, pairs and single lanes in turn */
static void transpose(float16 *m) {
    UNROLL for (int i = 0; i < 8; ++i) {
        const float16 a = m[i], b = m[i + 8];
        m[i] = (float16)(a.lo, b.lo);
        m[i + 8] = (float16)(a.hi, b.hi);
    }
    UNROLL for (int i = 0; i < 8; ++i) {
        const int k = (i & 3) + 2 * (i & 4);
        const float16 a = m[k], b = m[k + 4];
        m[k] = (float16)(a.s0123, b.s0123, a.s89ab, b.s89ab);
        m[k + 4] = (float16)(a.s4567, b.s4567, a.scdef, b.scdef);
    }
    UNROLL for (int i = 0; i < 8; ++i) {
        const int k = (i & 1) + 2 * (i & 6);
        const float16 a = m[k], b = m[k + 2];
        m[k] = (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd);
        m[k + 2] = (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef);
    }
    UNROLL for (int i = 0; i < 8; ++i) {
        const int k = 2 * i;
        const float16 a = m[k], b = m[k + 1];
        m[k] = (float16)(a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6, a.s8, b.s8, a.sa, b.sa, a.sc, b.sc, a.se, b.se);
        m[k + 1] = (float16)(a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7, a.s9, b.s9, a.sb, b.sb, a.sd, b.sd, a.sf, b.sf);
    }
}

__kernel void polar_spectrum(__global const float *stack, __global const float *decay, const Grid grid,
                             __global const double *radius, __global const double *azimuth,
                             __global const float *series, const double fx_max, const double fy_max,
                             __global float *spectrum) {
    const int i = get_global_id(0), radii = get_global_size(0), tile = get_global_id(1);
    __global float *here = spectrum + ((long)tile * radii + i) * 16 * S_NODES;
    __global float *opposite = here + (long)get_global_size(1) * radii * 16 * S_NODES;

    double16 fx = radius[i] * vload16(2 * tile, azimuth), fy = radius[i] * vload16(2 * tile + 1, azimuth);
    /* the stack holds the half plane fx >= 0 */
    const double16 turn = select((double16)1.0, (double16)-1.0, fx < 0.0);
    fx *= turn;
    fy *= turn;
    const int16 known = convert_int16(fx <= fx_max && fabs(fy) <= fy_max);
    const double16 x = rint(fx / grid.dfx), y = rint(fy / grid.dfy);
    float16 along_x[TAPS_X], along_y[TAPS_Y];
    window_weights(convert_float16(fx - x * grid.dfx), grid.dfx, grid.inverse_2_variance, decay, REACH_X, along_x);
    window_weights(convert_float16(fy - y * grid.dfy), grid.dfy, grid.inverse_2_variance, decay + TAPS_X, REACH_Y, along_y);
    const int16 row = convert_int16(y) - REACH_Y + grid.row_zero, column = convert_int16(x) - REACH_X + grid.column_zero;

    float16 ahead[S_BLOCKS][16], behind[S_BLOCKS][16];
    for (int lane = 0; lane < 16; ++lane) {
        float re[16 * BLOCKS], im[16 * BLOCKS];
        const int lit = ((const int *)&known)[lane], turned = ((const double *)&turn)[lane] < 0.0;
        if (lit) {
            const long first = (long)((const int *)&row)[lane] * grid.columns + ((const int *)&column)[lane];
            gather(stack + first * CELL, grid.columns, (const float *)along_x + lane, (const float *)along_y + lane, re, im);
        }
        for (int b = 0; b < S_BLOCKS; ++b) {
            float16 even_re = 0.0f, even_im = 0.0f, odd_re = 0.0f, odd_im = 0.0f;
            if (lit)
                UNROLL for (int n = 0; n < 16 * BLOCKS; n += 2) {
                    const float16 even = vload16(n * S_BLOCKS + b, series), odd = vload16((n + 1) * S_BLOCKS + b, series);
                    even_re = fma((float16)re[n], even, even_re);
                    even_im = fma((float16)im[n], even, even_im);
                    odd_re = fma((float16)re[n + 1], odd, odd_re);
                    odd_im = fma((float16)im[n + 1], odd, odd_im);
                }
            const float16 plus_re = even_re - odd_im, plus_im = even_im + odd_re;
            const float16 minus_re = even_re + odd_im, minus_im = even_im - odd_re;
            const float16 plus = plus_re * plus_re + plus_im * plus_im, minus = minus_re * minus_re + minus_im * minus_im;
            ahead[b][lane] = turned ? minus : plus;
            behind[b][lane] = turned ? plus : minus;
        }
    }
    for (int b = 0; b < S_BLOCKS; ++b) {
        transpose(ahead[b]);
        transpose(behind[b]);
        UNROLL for (int s = 0; s < 16; ++s)
            if (16 * b + s < S_NODES) {
                vstore16(ahead[b][s], 16 * b + s, here);
                vstore16(behind[b][s], 16 * b + s, opposite);
            }
    }
}
