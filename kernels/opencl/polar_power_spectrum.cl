/* Power spectrum E(r, phi, s) = |P(r (cos phi, sin phi); s)|^2 on a polar grid, from the Chebyshev stack.
 *
 *   P(f; s) = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f),  s = k w          (Jacobi-Anger; F_n as in eq. 8 of
 *                                                                          Dhillon et al. 2014, of T_n(h/H))
 *
 * With A the sum over even n and i B that over odd n, P(f) = A + i B; heights are real, so F_n(-f) is the conjugate
 * and |P(-f)| = |A - i B|: both half turns come from one gather.
 *
 *   stack    float[rows][columns][2][16 * blocks]    F_n: real and imaginary parts, terms side by side
 *   decay    float[2 * reach_x + 1], then [2 * reach_y + 1]   the window's transform at j spacings from its peak
 *   radius   double[radii]                           r, 1/um
 *   azimuth  double[tiles][2][16]                    cos phi, then sin phi, of half a turn
 *   series   float[16 * blocks][s_nodes]             (-1)^floor(n/2) (2 - [n = 0]) J_n(s H), zero beyond the last term
 *   spectrum float[2 * tiles][radii][s_nodes][16]    E: the tiles of the half turn, then those half a turn on;
 *                                                    azimuths of a tile side by side
 *   fx_max, fy_max                                   the scan's band, 1/um: beyond it nothing is known and E = 0
 *
 * Sums are float: T_n and J_n are bounded by 1, nothing cancels. Positions are double: f / df has 4 digits before
 * the point. One work-item, one radius and the sixteen azimuths of a tile.
 *
 * Given at launch: terms, even; the stack's blocks; s_nodes; reach_x and reach_y. Set by the host: USUAL_TAPS, the width
 * of a window whose loop along x is written out; MOST_BLOCKS and MOST_TAPS, which bound what a work-item keeps.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")
#define ROLLED _Pragma("nounroll")  /* copies of a loop's body would cost compiling time and win nothing */
/* a function that is compiled by itself, called where its loops begin: the compiler's time grows faster than a body's length */
#define APART __attribute__((noinline))
#define INLINE __attribute__((always_inline))

/* E is larger than caches: lines written past them need not be read first */
#if defined(__has_builtin)
#if __has_builtin(__builtin_nontemporal_store)
#define STORE(value, to) __builtin_nontemporal_store(value, (__global float16 *)(to))
#endif
#endif
#ifndef STORE
#define STORE(value, to) vstore16(value, 0, to)
#endif

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
    ROLLED for (int j = 1; j <= reach; ++j) {
        up *= ratio;
        down *= back;
        weight[reach + j] = up * decay[reach + j];
        weight[reach - j] = down * decay[reach - j];
    }
}

/* F_n(f) of one block of 16 terms: the window along x, row by row, then along y; `cell` floats from cell to cell */
static INLINE void gather(__global const float *corner, const int columns, const int cell, const int taps_x,
                          const int taps_y, const float16 *along_x, const float16 *along_y, const int lane, float16 *re,
                          float16 *im) {
    float16 sum_re = 0.0f, sum_im = 0.0f;
    /* written out as well, a wide window's rows would take the compiler minutes */
    ROLLED for (int t = 0; t < taps_y; ++t) {
        __global const float *row = corner + (long)t * columns * cell;
        float16 row_re = 0.0f, row_im = 0.0f;
        UNROLL for (int s = 0; s < taps_x; ++s) {
            const float16 weight = ((const float *)along_x)[16 * s + lane];
            row_re = fma(weight, vload16(0, row + s * cell), row_re);
            row_im = fma(weight, vload16(0, row + s * cell + cell / 2), row_im);
        }
        const float16 weight = ((const float *)along_y)[16 * t + lane];
        sum_re = fma(weight, row_re, sum_re);
        sum_im = fma(weight, row_im, sum_im);
    }
    *re = sum_re;
    *im = sum_im;
}

/* rows and columns of sixteen vectors change places: halves, quarters, pairs and single lanes in turn */
static APART void transpose(float16 *m) {
    ROLLED for (int i = 0; i < 8; ++i) {
        const float16 a = m[i], b = m[i + 8];
        m[i] = (float16)(a.lo, b.lo);
        m[i + 8] = (float16)(a.hi, b.hi);
    }
    ROLLED for (int i = 0; i < 8; ++i) {
        const int k = (i & 3) + 2 * (i & 4);
        const float16 a = m[k], b = m[k + 4];
        m[k] = (float16)(a.s0123, b.s0123, a.s89ab, b.s89ab);
        m[k + 4] = (float16)(a.s4567, b.s4567, a.scdef, b.scdef);
    }
    ROLLED for (int i = 0; i < 8; ++i) {
        const int k = (i & 1) + 2 * (i & 6);
        const float16 a = m[k], b = m[k + 2];
        m[k] = (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd);
        m[k + 2] = (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef);
    }
    ROLLED for (int i = 0; i < 8; ++i) {
        const int k = 2 * i;
        const float16 a = m[k], b = m[k + 1];
        m[k] = (float16)(a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6, a.s8, b.s8, a.sa, b.sa, a.sc, b.sc, a.se, b.se);
        m[k + 1] = (float16)(a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7, a.s9, b.s9, a.sb, b.sb, a.sd, b.sd, a.sf, b.sf);
    }
}

/* Where the window lies for sixteen azimuths of a radius: its weights along x and y, its first column and row; turned:
 * the opposite of f is gathered, for the stack holds the half plane fx >= 0; known: within the scan's band */
typedef struct {
    float16 weight[2][MOST_TAPS];
    int16 first[2], turned, known;
} Window;

/* rint below 2^51, which PoCL works out in twenty operations: 1.5 * 2^52 leaves no digits for what follows the point */
static double16 nearest(const double16 x) { return (x + 6755399441055744.0) - 6755399441055744.0; }

static APART void place_window(const Grid grid, __global const float *decay, __global const double *azimuth, const double radius,
                         const double fx_max, const double fy_max, const int reach_x, const int reach_y, Window *window) {
    const double16 turn = select((double16)1.0, (double16)-1.0, radius * vload16(0, azimuth) < 0.0);
    const int origin[2] = {grid.column_zero, grid.row_zero}, reach[2] = {reach_x, reach_y};
    const double df[2] = {grid.dfx, grid.dfy}, f_max[2] = {fx_max, fy_max};
    window->turned = convert_int16(turn < 0.0);
    window->known = -1;
    ROLLED for (int axis = 0; axis < 2; ++axis, decay += 2 * reach_x + 1) {
        const double16 f = turn * radius * vload16(axis, azimuth), cell = nearest(f * (1.0 / df[axis]));
        window_weights(convert_float16(f - cell * df[axis]), df[axis], grid.inverse_2_variance, decay, reach[axis],
                       window->weight[axis]);
        window->first[axis] = convert_int16(cell) - reach[axis] + origin[axis];
        window->known &= convert_int16(fabs(f) <= f_max[axis]);
    }
}

/* F_n at one azimuth of a window, zero beyond the scan's band: [2][blocks][16 azimuths] */
static APART void gather_azimuth(__global const float *stack, const int columns, const int blocks, const int taps_x,
                           const int taps_y, const Window *window, const int lane, float16 *f_n) {
    if (!((const int *)&window->known)[lane]) {
        ROLLED for (int b = 0; b < 2 * blocks; ++b) f_n[16 * b + lane] = 0.0f;
        return;
    }
    const int cell = 32 * blocks;
    const long first = (long)((const int *)&window->first[1])[lane] * columns + ((const int *)&window->first[0])[lane];
    ROLLED for (int b = 0; b < blocks; ++b) {
        __global const float *corner = stack + first * cell + 16 * b;
        float16 *re_b = f_n + 16 * b + lane, *im_b = re_b + 16 * blocks;
        if (taps_x == USUAL_TAPS && cell == 32)
            gather(corner, columns, 32, USUAL_TAPS, taps_y, window->weight[0], window->weight[1], lane, re_b, im_b);
        else
            gather(corner, columns, cell, taps_x, taps_y, window->weight[0], window->weight[1], lane, re_b, im_b);
    }
}

/* E at one node in s from F_n, [terms], azimuths side by side; `opposite` takes those of the opposite azimuths */
static APART void power_at_node(const float16 *re, const float16 *im, const int16 turned, const int terms, const int s_nodes,
                          __global const float *series, __global float *here, __global float *opposite) {
    float16 even_re = 0.0f, even_im = 0.0f, odd_re = 0.0f, odd_im = 0.0f;
    ROLLED for (int n = 0; n < terms; n += 2) {
        const float16 even = series[n * s_nodes], odd = series[(n + 1) * s_nodes];
        even_re = fma(even, re[n], even_re);
        even_im = fma(even, im[n], even_im);
        odd_re = fma(odd, re[n + 1], odd_re);
        odd_im = fma(odd, im[n + 1], odd_im);
    }
    const float16 plus_re = even_re - odd_im, plus_im = even_im + odd_re;
    const float16 minus_re = even_re + odd_im, minus_im = even_im - odd_re;
    const float16 plus = plus_re * plus_re + plus_im * plus_im, minus = minus_re * minus_re + minus_im * minus_im;
    STORE(select(plus, minus, turned), here);
    STORE(select(minus, plus, turned), opposite);
}

__kernel void polar_power_spectrum(__global const float *stack, __global const float *decay, const Grid grid,
                             __global const double *radius, const int radii, __global const double *azimuth,
                             __global const float *series, const int terms, const int blocks, const int s_nodes,
                             const int reach_x, const int reach_y, const double fx_max, const double fy_max,
                             __global float *spectrum) {
    const int ring = get_global_id(0), tile = get_global_id(1), tiles = get_global_size(1);
    __global float *here = spectrum + ((long)tile * radii + ring) * 16 * s_nodes;
    __global float *opposite = here + (long)tiles * radii * 16 * s_nodes;

    Window window;
    place_window(grid, decay, azimuth + 32 * tile, radius[ring], fx_max, fy_max, reach_x, reach_y, &window);
    /* real parts, then imaginary parts */
    float16 f_n[2 * MOST_BLOCKS * 16];
    ROLLED for (int lane = 0; lane < 16; ++lane)
        gather_azimuth(stack, grid.columns, blocks, 2 * reach_x + 1, 2 * reach_y + 1, &window, lane, f_n);
    ROLLED for (int part = 0; part < 2 * blocks; ++part) transpose(f_n + 16 * part);
    ROLLED for (int j = 0; j < s_nodes; ++j)
        power_at_node(f_n, f_n + 16 * blocks, window.turned, terms, s_nodes, series + j, here + 16 * j, opposite + 16 * j);
}
