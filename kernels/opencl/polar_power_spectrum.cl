/* Polar power spectrum E(r, phi, s) = |P(r (cos phi, sin phi); s)|^2, from the Chebyshev stack, or its mean over windows.
 *
 *   P(f; s) = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f),  s = k w          (Jacobi-Anger; F_n as in eq. 8 of
 *                                                                          Dhillon et al. 2014, of T_n(h/H))
 *
 * With A the sum over even n and i B that over odd n, P(f) = A + i B; heights are real, so F_n(-f) is the conjugate
 * and |P(-f)| = |A - i B|: both half turns come from one gather.
 *
 * A window at a distance a from the middle multiplies coefficients by exp(-2 pi i f a). For windows at -a and a,
 *   |sum F exp(-2 pi i f a)|^2 + |sum F exp(2 pi i f a)|^2 = 2 |sum F cos(2 pi f a)|^2 + 2 |sum F sin(2 pi f a)|^2
 * so the mean over three windows along an axis is a sum of |P|^2 over MODES, each with real factors of its own.
 *
 * Sums are float: T_n and J_n are bounded by 1, nothing cancels. Positions are double: f / df has 4 digits before
 * the point. One work-item, one radius and the LANES azimuths of a tile. Arguments; taps = 2 * reach + 1:
 *
 * polar_power_spectrum
 *   stack     float[rows][columns][2][LANES * blocks]   1   F_n: real and imaginary parts, terms side by side
 *   decay     float[taps_x + taps_y]                 1     the window's transform at j spacings, of x, then of y
 *   grid      Grid                                   1/um  frequencies of the stack and the window's width
 *   radius    double[radii]                          1/um  r
 *   radii     int                                    1     of E
 *   azimuth   double[tiles][2][LANES]                1     cos phi, then sin phi, of half a turn
 *   series    float[LANES * blocks][s_nodes]         1     (-1)^floor(n/2) (2 - [n = 0]) J_n(s H), zero beyond the last
 *   terms     int                                    1     of the series, even
 *   blocks    int                                    1     vectors of terms in the stack
 *   s_nodes   int                                    1     nodes in s
 *   reach_x   int                                    1     coefficients on either side of the nearest, along x
 *   reach_y   int                                    1     and along y
 *   fx_max    double                                 1/um  Nyquist limit of the scan along x: E = 0 beyond it
 *   fy_max    double                                 1/um  and along y
 *   spectrum  float[HALVES * tiles][radii][s_nodes][LANES]   1   result: E of the tiles of the half turn, then of those
 *                                                          half a turn on; azimuths of a tile side by side
 *
 * mean_power_spectrum
 *   stack     float[rows][columns][2][LANES * blocks]   1   F_n: real and imaginary parts, terms side by side
 *   decay     float[taps_x + taps_y]                 1     the window's transform at j spacings, of x, then of y
 *   grid      Grid                                   1/um  frequencies of the stack and the window's width
 *   mode_x    float[columns][MODES]                  1     factor of each mode at the stack's columns
 *   mode_y    float[rows][MODES]                     1     and at its rows
 *   radius    double[radii]                          1/um  r
 *   radii     int                                    1     of E
 *   azimuth   double[tiles][2][LANES]                1     cos phi, then sin phi, of half a turn
 *   series    float[LANES * blocks][s_nodes]         1     (-1)^floor(n/2) (2 - [n = 0]) J_n(s H), zero beyond the last
 *   terms     int                                    1     of the series, even
 *   blocks    int                                    1     vectors of terms in the stack
 *   s_nodes   int                                    1     nodes in s
 *   reach_x   int                                    1     coefficients on either side of the nearest, along x
 *   reach_y   int                                    1     and along y
 *   fx_max    double                                 1/um  Nyquist limit of the scan along x: E = 0 beyond it
 *   fy_max    double                                 1/um  and along y
 *   spectrum  float[HALVES * tiles][radii][s_nodes][LANES]   1   result: as above
 *
 * Set by the host: LANES, 16; USUAL_TAPS, the width of a window whose loop along x is written out; NODES in s that are
 * summed at a time; MOST_BLOCKS and MOST_TAPS, which bound what a work-item keeps.
 */

#include "common.cl"
#define CELL (PARTS * LANES) /* floats of a cell of the stack, for each block of terms */
#define PAIRS (MODES * MODES) /* of a mode along x and one along y */

/* E is larger than caches: lines written past them need not be read first. */
#if defined(__has_builtin)
#if __has_builtin(__builtin_nontemporal_store)
#define STORE(value, to) __builtin_nontemporal_store(value, (__global float16 *)(to))
#endif
#endif
#ifndef STORE
#define STORE(value, to) vstore16(value, 0, to)
#endif

WINDOW_WEIGHTS(weights_of_peak, float16, float)

/* exp(-(d - j df)^2 / (2 sigma_f^2)), j = -reach .. reach, of a tile's azimuths at once: weight[tap] holds a tap's. */
static void window_weights(const float16 d, const float df, const float inverse_2_variance, __global const float *decay,
                           const int reach, float16 *weight) {
    const float16 peak = exp(-d * d * inverse_2_variance), ratio = exp(2.0f * df * inverse_2_variance * d);
    weights_of_peak(peak, ratio, decay, reach, weight);
}

/* F_n(f) of one block of terms: the window along x, row by row, then along y; `cell` floats from cell to cell. */
static INLINE void gather(__global const float *corner, const int columns, const int cell, const int taps_x,
                          const int taps_y, const float16 *along_x, const float16 *along_y, const int lane, float16 *re,
                          float16 *im) {
    float16 sum_re = 0.0f, sum_im = 0.0f;
    /* written out as well, a wide window's rows would take the compiler minutes */
    ROLLED for (int t = 0; t < taps_y; ++t) {
        __global const float *row = corner + (long)t * columns * cell;
        float16 row_re = 0.0f, row_im = 0.0f;
        UNROLL for (int s = 0; s < taps_x; ++s) {
            const float16 weight = ((const float *)along_x)[LANES * s + lane];
            row_re = fma(weight, vload16(0, row + s * cell), row_re);
            row_im = fma(weight, vload16(0, row + s * cell + cell / PARTS), row_im);
        }
        const float16 weight = ((const float *)along_y)[LANES * t + lane];
        sum_re = fma(weight, row_re, sum_re);
        sum_im = fma(weight, row_im, sum_im);
    }
    *re = sum_re;
    *im = sum_im;
}

/* Rows and columns of LANES vectors change places: halves, quarters, pairs and single lanes in turn. */
static APART void transpose(float16 *m) {
    ROLLED for (int i = 0; i < LANES / 2; ++i) {
        const float16 a = m[i], b = m[i + LANES / 2];
        m[i] = (float16)(a.lo, b.lo);
        m[i + LANES / 2] = (float16)(a.hi, b.hi);
    }
    ROLLED for (int i = 0; i < LANES / 2; ++i) {
        const int k = (i & 3) + 2 * (i & 4);
        const float16 a = m[k], b = m[k + 4];
        m[k] = (float16)(a.s0123, b.s0123, a.s89ab, b.s89ab);
        m[k + 4] = (float16)(a.s4567, b.s4567, a.scdef, b.scdef);
    }
    ROLLED for (int i = 0; i < LANES / 2; ++i) {
        const int k = (i & 1) + 2 * (i & 6);
        const float16 a = m[k], b = m[k + 2];
        m[k] = (float16)(a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd);
        m[k + 2] = (float16)(a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef);
    }
    ROLLED for (int i = 0; i < LANES / 2; ++i) {
        const int k = 2 * i;
        const float16 a = m[k], b = m[k + 1];
        m[k] =
            (float16)(a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6, a.s8, b.s8, a.sa, b.sa, a.sc, b.sc, a.se, b.se);
        m[k + 1] =
            (float16)(a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7, a.s9, b.s9, a.sb, b.sb, a.sd, b.sd, a.sf, b.sf);
    }
}

/* Where the window lies for the azimuths of a tile at one radius. */
typedef struct {
    float16 weight[2][MOST_TAPS]; /* along x and y */
    int16 first[2];               /* column and row of the first coefficient */
    int16 turned;                 /* the opposite of f is gathered, for the stack holds the half plane fx >= 0 */
    int16 known;                  /* within the Nyquist limits */
} Window;

/* rint below 2^51: PoCL takes twenty operations for rint, and 1.5 * 2^52 leaves no digits after the point. */
#define ROUNDING 6755399441055744.0
static double16 nearest(const double16 x) { return (x + ROUNDING) - ROUNDING; }

static APART void place_window(const Grid grid, __global const float *decay, __global const double *azimuth,
                               const double radius, const double fx_max, const double fy_max, const int reach_x,
                               const int reach_y, Window *window) {
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

/* F_n at one azimuth of a tile, zero beyond the Nyquist limits: f_n[part][blocks * LANES vectors][lane = azimuth]. */
static INLINE void gather_azimuth(__global const float *stack, const int columns, const int blocks, const int taps_x,
                                  const int taps_y, const Window *window, const int lane, float16 *f_n) {
    if (!((const int *)&window->known)[lane]) {
        ROLLED for (int b = 0; b < PARTS * blocks; ++b) f_n[LANES * b + lane] = 0.0f;
        return;
    }
    const int cell = CELL * blocks;
    const int first_column = ((const int *)&window->first[0])[lane], first_row = ((const int *)&window->first[1])[lane];
    const long first = (long)first_row * columns + first_column;
    ROLLED for (int b = 0; b < blocks; ++b) {
        __global const float *corner = stack + first * cell + LANES * b;
        float16 *re_b = f_n + LANES * b + lane, *im_b = re_b + LANES * blocks;
        /* with the usual window and one block of terms, the compiler knows every address of a row */
        if (taps_x == USUAL_TAPS && cell == CELL)
            gather(corner, columns, CELL, USUAL_TAPS, taps_y, window->weight[0], window->weight[1], lane, re_b, im_b);
        else
            gather(corner, columns, cell, taps_x, taps_y, window->weight[0], window->weight[1], lane, re_b, im_b);
    }
}

/* F_n of all azimuths of a tile: f_n[part][term][azimuth]. */
static APART void gather_tile(__global const float *stack, const int columns, const int blocks, const int taps_x,
                              const int taps_y, const Window *window, float16 *f_n) {
    ROLLED for (int lane = 0; lane < LANES; ++lane)
        gather_azimuth(stack, columns, blocks, taps_x, taps_y, window, lane, f_n);
    ROLLED for (int block = 0; block < PARTS * blocks; ++block) transpose(f_n + LANES * block);
}

/* E at `nodes` nodes in s from F_n, re and im [terms][azimuths]; `opposite` takes those of the opposite azimuths. */
static INLINE void power_of_nodes(const float16 *re, const float16 *im, const int16 turned, const int terms,
                                  const int nodes, const int s_nodes, __global const float *series,
                                  __global float *here, __global float *opposite) {
    float16 even_re[NODES], even_im[NODES], odd_re[NODES], odd_im[NODES];
    UNROLL for (int j = 0; j < nodes; ++j) even_re[j] = even_im[j] = odd_re[j] = odd_im[j] = 0.0f;
    ROLLED for (int n = 0; n < terms; n += 2)
        UNROLL for (int j = 0; j < nodes; ++j) {
            const float16 even = series[n * s_nodes + j], odd = series[(n + 1) * s_nodes + j];
            even_re[j] = fma(even, re[n], even_re[j]);
            even_im[j] = fma(even, im[n], even_im[j]);
            odd_re[j] = fma(odd, re[n + 1], odd_re[j]);
            odd_im[j] = fma(odd, im[n + 1], odd_im[j]);
        }
    UNROLL for (int j = 0; j < nodes; ++j) {
        const float16 plus_re = even_re[j] - odd_im[j], plus_im = even_im[j] + odd_re[j];
        const float16 minus_re = even_re[j] + odd_im[j], minus_im = even_im[j] - odd_re[j];
        const float16 plus = plus_re * plus_re + plus_im * plus_im, minus = minus_re * minus_re + minus_im * minus_im;
        STORE(select(plus, minus, turned), here + LANES * j);
        STORE(select(minus, plus, turned), opposite + LANES * j);
    }
}

/* E of a tile at every node in s. */
static APART void power_at_nodes(const float16 *re, const float16 *im, const int16 turned, const int terms,
                                 const int s_nodes, __global const float *series, __global float *here,
                                 __global float *opposite) {
    int j = 0;
    ROLLED for (; j + NODES <= s_nodes; j += NODES)
        power_of_nodes(re, im, turned, terms, NODES, s_nodes, series + j, here + LANES * j, opposite + LANES * j);
    ROLLED for (; j < s_nodes; ++j)
        power_of_nodes(re, im, turned, terms, 1, s_nodes, series + j, here + LANES * j, opposite + LANES * j);
}

__kernel void polar_power_spectrum(__global const float *stack, __global const float *decay, const Grid grid,
                                   __global const double *radius, const int radii, __global const double *azimuth,
                                   __global const float *series, const int terms, const int blocks, const int s_nodes,
                                   const int reach_x, const int reach_y, const double fx_max, const double fy_max,
                                   __global float *spectrum) {
    const int ring = get_global_id(0), tile = get_global_id(1), tiles = get_global_size(1);
    __global float *here = spectrum + ((long)tile * radii + ring) * s_nodes * LANES;
    __global float *opposite = here + (long)tiles * radii * s_nodes * LANES;

    Window window;
    place_window(grid, decay, azimuth + 2 * LANES * tile, radius[ring], fx_max, fy_max, reach_x, reach_y, &window);
    /* terms are gathered side by side, and used with azimuths side by side */
    float16 f_n[PARTS * MOST_BLOCKS * LANES];
    gather_tile(stack, grid.columns, blocks, 2 * reach_x + 1, 2 * reach_y + 1, &window, f_n);
    power_at_nodes(f_n, f_n + LANES * blocks, window.turned, terms, s_nodes, series, here, opposite);
}

/* The weights of each mode: those of the window times the mode's factors at the coefficients of every azimuth. */
static APART void mode_weights(const float16 *weight, const int16 first, __global const float *mode, const int taps,
                               float16 (*weights)[MOST_TAPS]) {
    ROLLED for (int t = 0; t < taps; ++t) {
        float16 factor[MODES];
        ROLLED for (int lane = 0; lane < LANES; ++lane) {
            __global const float *here = mode + (((const int *)&first)[lane] + t) * MODES;
            UNROLL for (int m = 0; m < MODES; ++m) ((float *)&factor[m])[lane] = here[m];
        }
        UNROLL for (int m = 0; m < MODES; ++m) weights[m][t] = factor[m] * weight[t];
    }
}

/* A row's sums along x of one block of terms, for every mode: row[mode][part]. */
static INLINE void row_modes(__global const float *row, const int cell, const int taps_x, const int lane,
                             const float16 (*along_x)[MOST_TAPS], float16 (*sum)[PARTS]) {
    float16 re[MODES], im[MODES];
    UNROLL for (int m = 0; m < MODES; ++m) re[m] = im[m] = 0.0f;
    ROLLED for (int s = 0; s < taps_x; ++s) {
        const float16 f_re = vload16(0, row + s * cell), f_im = vload16(0, row + s * cell + cell / PARTS);
        UNROLL for (int m = 0; m < MODES; ++m) {
            const float16 weight = ((const float *)&along_x[m][s])[lane];
            re[m] = fma(weight, f_re, re[m]);
            im[m] = fma(weight, f_im, im[m]);
        }
    }
    UNROLL for (int m = 0; m < MODES; ++m) {
        sum[m][0] = re[m];
        sum[m][1] = im[m];
    }
}

/* F_n of one block of terms at one azimuth, for every pair of modes, `stride` vectors apart. */
static APART void gather_modes(__global const float *corner, const int columns, const int cell, const int taps_x,
                               const int taps_y, const float16 (*weights)[MODES][MOST_TAPS], const int lane,
                               const int stride, const int part_stride, float16 *f_n) {
    float16 sum[PAIRS][PARTS];
    ROLLED for (int p = 0; p < PAIRS; ++p) sum[p][0] = sum[p][1] = 0.0f;
    ROLLED for (int t = 0; t < taps_y; ++t) {
        float16 row[MODES][PARTS];
        row_modes(corner + (long)t * columns * cell, cell, taps_x, lane, weights[0], row);
        UNROLL for (int p = 0; p < PAIRS; ++p) {
            const float16 weight = ((const float *)&weights[1][p / MODES][t])[lane];
            sum[p][0] = fma(weight, row[p % MODES][0], sum[p][0]);
            sum[p][1] = fma(weight, row[p % MODES][1], sum[p][1]);
        }
    }
    ROLLED for (int p = 0; p < PAIRS; ++p) {
        f_n[p * stride] = sum[p][0];
        f_n[p * stride + part_stride] = sum[p][1];
    }
}

/* |P|^2 of all pairs of modes at one node in s, at the azimuths of a tile and at the opposite ones. */
static APART void mean_at_node(const float16 *f_n, const int blocks, const int16 turned, const int terms,
                               const int s_nodes, __global const float *series, __global float *here,
                               __global float *opposite) {
    float16 plus = 0.0f, minus = 0.0f;
    ROLLED for (int p = 0; p < PAIRS; ++p) {
        const float16 *re = f_n + p * PARTS * blocks * LANES, *im = re + blocks * LANES;
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
        plus += plus_re * plus_re + plus_im * plus_im;
        minus += minus_re * minus_re + minus_im * minus_im;
    }
    STORE(select(plus, minus, turned), here);
    STORE(select(minus, plus, turned), opposite);
}

__kernel void mean_power_spectrum(__global const float *stack, __global const float *decay, const Grid grid,
                                  __global const float *mode_x, __global const float *mode_y,
                                  __global const double *radius, const int radii, __global const double *azimuth,
                                  __global const float *series, const int terms, const int blocks, const int s_nodes,
                                  const int reach_x, const int reach_y, const double fx_max, const double fy_max,
                                  __global float *spectrum) {
    const int ring = get_global_id(0), tile = get_global_id(1), tiles = get_global_size(1);
    const int taps_x = 2 * reach_x + 1, taps_y = 2 * reach_y + 1, cell = CELL * blocks;
    __global float *here = spectrum + ((long)tile * radii + ring) * s_nodes * LANES;
    __global float *opposite = here + (long)tiles * radii * s_nodes * LANES;

    Window window;
    place_window(grid, decay, azimuth + 2 * LANES * tile, radius[ring], fx_max, fy_max, reach_x, reach_y, &window);
    /* beyond the Nyquist limits there may be no coefficients; what is gathered instead is not used */
    const int16 inside = window.known;
    const int16 column = select((int16)0, window.first[0], inside), row = select((int16)0, window.first[1], inside);
    float16 weights[2][MODES][MOST_TAPS];
    mode_weights(window.weight[0], column, mode_x, taps_x, weights[0]);
    mode_weights(window.weight[1], row, mode_y, taps_y, weights[1]);
    /* [pair of modes][part][term][azimuth] */
    float16 f_n[PAIRS * PARTS * MOST_BLOCKS * LANES];
    ROLLED for (int lane = 0; lane < LANES; ++lane) {
        const int known = ((const int *)&inside)[lane];
        const long first = (long)((const int *)&row)[lane] * grid.columns + ((const int *)&column)[lane];
        ROLLED for (int b = 0; b < blocks; ++b) {
            float16 *to = f_n + LANES * b + lane;
            if (known)
                gather_modes(stack + first * cell + LANES * b, grid.columns, cell, taps_x, taps_y, weights, lane,
                             PARTS * blocks * LANES, blocks * LANES, to);
            else
                ROLLED for (int p = 0; p < PAIRS * PARTS; ++p) to[p * blocks * LANES] = 0.0f;
        }
    }
    ROLLED for (int block = 0; block < PAIRS * PARTS * blocks; ++block) transpose(f_n + LANES * block);
    ROLLED for (int j = 0; j < s_nodes; ++j)
        mean_at_node(f_n, blocks, window.turned, terms, s_nodes, series + j, here + LANES * j, opposite + LANES * j);
}
