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
 *   series   float[16 * BLOCKS][S_NODES]             (-1)^floor(n/2) (2 - [n = 0]) J_n(s H), zero beyond the last term
 *   spectrum float[2 * tiles][radii][S_NODES][16]    E: the tiles of the half turn, then those half a turn on;
 *                                                    azimuths of a tile side by side
 *   fx_max, fy_max                                   the scan's band, 1/um: beyond it nothing is known and E = 0
 *
 * Sums are float: T_n and J_n are bounded by 1, nothing cancels. Positions are double: f / df has 4 digits before
 * the point. One work-item, RADII radii and the sixteen azimuths of a tile.
 *
 * Set by the host: TERMS, even, in BLOCKS of 16, S_NODES and S_BLOCK of them, RADII, REACH_X and REACH_Y.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")
#define TAPS_X (2 * REACH_X + 1)
#define TAPS_Y (2 * REACH_Y + 1)
#define CELL (32 * BLOCKS)

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
    for (int j = 1; j <= reach; ++j) {
        up *= ratio;
        down *= back;
        weight[reach + j] = up * decay[reach + j];
        weight[reach - j] = down * decay[reach - j];
    }
}

/* F_n(f) of one block of 16 terms: the window along x, row by row, then along y */
static void gather(__global const float *corner, const int columns, const float16 *along_x, const float *along_y,
                   float16 *re, float16 *im) {
    float16 sum_re = 0.0f, sum_im = 0.0f;
    /* written out as well, a wide window's rows would take the compiler minutes */
    _Pragma("nounroll") for (int t = 0; t < TAPS_Y; ++t) {
        __global const float *cell = corner + (long)t * columns * CELL;
        float16 row_re = 0.0f, row_im = 0.0f;
        UNROLL for (int s = 0; s < TAPS_X; ++s) {
            row_re = fma(along_x[s], vload16(0, cell + s * CELL), row_re);
            row_im = fma(along_x[s], vload16(0, cell + s * CELL + 16 * BLOCKS), row_im);
        }
        const float16 weight = along_y[16 * t];
        sum_re = fma(weight, row_re, sum_re);
        sum_im = fma(weight, row_im, sum_im);
    }
    *re = sum_re;
    *im = sum_im;
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

/* Where the window lies for sixteen azimuths of a radius: its weights, its first cells; turned: the opposite of f is
 * gathered, for the stack holds the half plane fx >= 0; known: within the scan's band */
typedef struct {
    float16 along_x[TAPS_X], along_y[TAPS_Y];
    int16 row, column, turned, known;
} Window;

/* rint below 2^51, which PoCL works out in twenty operations: 1.5 * 2^52 leaves no digits for what follows the point */
static double16 nearest(const double16 x) { return (x + 6755399441055744.0) - 6755399441055744.0; }

static void place_window(const Grid grid, __global const float *decay, double16 fx, double16 fy, const double fx_max,
                         const double fy_max, Window *window) {
    const double16 turn = select((double16)1.0, (double16)-1.0, fx < 0.0);
    fx *= turn;
    fy *= turn;
    const double16 x = nearest(fx * (1.0 / grid.dfx)), y = nearest(fy * (1.0 / grid.dfy));
    window_weights(convert_float16(fx - x * grid.dfx), grid.dfx, grid.inverse_2_variance, decay, REACH_X, window->along_x);
    window_weights(convert_float16(fy - y * grid.dfy), grid.dfy, grid.inverse_2_variance, decay + TAPS_X, REACH_Y, window->along_y);
    window->row = convert_int16(y) - REACH_Y + grid.row_zero;
    window->column = convert_int16(x) - REACH_X + grid.column_zero;
    window->turned = convert_int16(turn < 0.0);
    window->known = convert_int16(fx <= fx_max && fabs(fy) <= fy_max);
}

/* F_n at one azimuth of a window, zero beyond the scan's band */
static void gather_azimuth(__global const float *stack, const int columns, const Window *window, const int lane,
                           float16 (*re)[16], float16 (*im)[16]) {
    if (!((const int *)&window->known)[lane]) {
        for (int b = 0; b < BLOCKS; ++b) re[b][lane] = im[b][lane] = 0.0f;
        return;
    }
    const long first = (long)((const int *)&window->row)[lane] * columns + ((const int *)&window->column)[lane];
    float16 along_x[TAPS_X];
    UNROLL for (int s = 0; s < TAPS_X; ++s) along_x[s] = ((const float *)window->along_x)[16 * s + lane];
    for (int b = 0; b < BLOCKS; ++b)
        gather(stack + first * CELL + 16 * b, columns, along_x, (const float *)window->along_y + lane, &re[b][lane],
               &im[b][lane]);
}

/* E at a few nodes in s from F_n, azimuths side by side: at most S_BLOCK, a constant at either call, so that their sums
 * stay in registers */
static __attribute__((always_inline)) void power_at_nodes(const float16 (*re)[16], const float16 (*im)[16], const int16 turned,
                                                           const int nodes, __global const float *series,
                                                           __global float *here, __global float *opposite) {
    float16 even_re[S_BLOCK], even_im[S_BLOCK], odd_re[S_BLOCK], odd_im[S_BLOCK];
    UNROLL for (int j = 0; j < nodes; ++j) even_re[j] = even_im[j] = odd_re[j] = odd_im[j] = 0.0f;
    for (int b = 0; b < BLOCKS; ++b)
        UNROLL for (int n = 0; n < 16; n += 2) {
            __global const float *even = series + (16 * b + n) * S_NODES, *odd = even + S_NODES;
            if (16 * b + n >= TERMS) break;
            UNROLL for (int j = 0; j < nodes; ++j) {
                even_re[j] = fma((float16)even[j], re[b][n], even_re[j]);
                even_im[j] = fma((float16)even[j], im[b][n], even_im[j]);
                odd_re[j] = fma((float16)odd[j], re[b][n + 1], odd_re[j]);
                odd_im[j] = fma((float16)odd[j], im[b][n + 1], odd_im[j]);
            }
        }
    UNROLL for (int j = 0; j < nodes; ++j) {
        const float16 plus_re = even_re[j] - odd_im[j], plus_im = even_im[j] + odd_re[j];
        const float16 minus_re = even_re[j] + odd_im[j], minus_im = even_im[j] - odd_re[j];
        const float16 plus = plus_re * plus_re + plus_im * plus_im, minus = minus_re * minus_re + minus_im * minus_im;
        STORE(select(plus, minus, turned), here + 16 * j);
        STORE(select(minus, plus, turned), opposite + 16 * j);
    }
}

__kernel void polar_spectrum(__global const float *stack, __global const float *decay, const Grid grid,
                             __global const double *radius, const int radii, __global const double *azimuth,
                             __global const float *series, const double fx_max, const double fy_max,
                             __global float *spectrum) {
    const int first = RADII * get_global_id(0), count = min(RADII, radii - first), tile = get_global_id(1);
    __global float *here = spectrum + ((long)tile * radii + first) * 16 * S_NODES;
    __global float *opposite = here + (long)get_global_size(1) * radii * 16 * S_NODES;

    Window window[RADII];
    const double16 along_x = vload16(2 * tile, azimuth), along_y = vload16(2 * tile + 1, azimuth);
    for (int i = 0; i < count; ++i)
        place_window(grid, decay, radius[first + i] * along_x, radius[first + i] * along_y, fx_max, fy_max, window + i);
    float16 re[RADII][BLOCKS][16], im[RADII][BLOCKS][16];
    /* radii inside: the next one's window lies in almost the same cells */
    for (int lane = 0; lane < 16; ++lane)
        for (int i = 0; i < count; ++i) gather_azimuth(stack, grid.columns, window + i, lane, re[i], im[i]);
    for (int i = 0; i < count; ++i) {
        for (int b = 0; b < BLOCKS; ++b) {
            transpose(re[i][b]);
            transpose(im[i][b]);
        }
        __global float *ahead = here + (long)i * 16 * S_NODES, *behind = opposite + (long)i * 16 * S_NODES;
        const int whole = S_NODES - S_NODES % S_BLOCK;
        for (int s = 0; s < whole; s += S_BLOCK)
            power_at_nodes(re[i], im[i], window[i].turned, S_BLOCK, series + s, ahead + 16 * s, behind + 16 * s);
        power_at_nodes(re[i], im[i], window[i].turned, S_NODES % S_BLOCK, series + whole, ahead + 16 * whole, behind + 16 * whole);
    }
}
