/* Windowed DFT of the terms of a series: Dhillon et al. 2014, eq. 8.
 *
 *   F_n(f) = sum_(s,t) H_n[s, t] exp(-|f - (phi_s, psi_t)|^2 / (2 sigma_f^2))
 *
 * H_n[s, t] are the DFT coefficients of the n-th term (t^n, or T_n(t)) of a real height field, held for all n side
 * by side so that one vector load serves several terms:
 *
 *   stack[(row * columns + column) * 2 * 8 * BLOCKS + part * 8 * BLOCKS + n]   double
 *     row    psi = (row - row_zero) * dfy         column  phi = (column - column_zero) * dfx     1/um
 *     part   0 real, 1 imaginary                  n       term, zero beyond the last
 *
 *   decay[2 * reach_x + 1], then [2 * reach_y + 1]   double: the window at j spacings from its peak
 *
 * Given at launch: reach_x and reach_y, coefficients taken on either side of the nearest. Set by the host: BLOCKS,
 * vectors of 8 terms; MOST_TAPS, which bounds 2 reach + 1.
 */

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

/* sums over BLOCKS stay in registers only when their loops are written out */
#define UNROLL _Pragma("unroll")

typedef struct {
    double dfx, dfy;            /* spacing of the DFT's frequencies, 1/um */
    double inverse_2_variance;  /* 1 / (2 sigma_f^2), um^2 */
    int columns, row_zero, column_zero;
} Grid;

/* exp(-(d - j df)^2 / (2 sigma_f^2)), j = -reach .. reach, from e = exp(-d^2 / (2 sigma_f^2)), ratio = exp(d df / sigma_f^2)
 * and decay_j = exp(-(j df)^2 / (2 sigma_f^2)): one exponential for all coefficients of an axis. */
static void window_weights(const double e, const double ratio, __global const double *decay, const int reach,
                           double *weight) {
    double up = e, down = e;
    const double inverse = 1.0 / ratio;
    weight[reach] = e;
    for (int j = 1; j <= reach; ++j) {
        up *= ratio;
        down *= inverse;
        weight[reach + j] = up * decay[reach + j];
        weight[reach - j] = down * decay[reach - j];
    }
}

/* F_n(fx, fy) for all terms, into re and im (BLOCKS vectors each). (fx, fy) must lie within the stack. */
static void windowed_dft(__global const double *stack, __global const double *decay, const Grid grid,
                         const int reach_x, const int reach_y, const double fx, const double fy, double8 *re,
                         double8 *im) {
    for (int b = 0; b < BLOCKS; ++b) {
        re[b] = 0.0;
        im[b] = 0.0;
    }
    const int nearest_x = (int)rint(fx / grid.dfx), nearest_y = (int)rint(fy / grid.dfy);
    const double dx = fx - nearest_x * grid.dfx, dy = fy - nearest_y * grid.dfy;
    const double4 factors = exp((double4)(-dx * dx, 2.0 * dx * grid.dfx, -dy * dy, 2.0 * dy * grid.dfy) *
                                grid.inverse_2_variance);
    double along_x[MOST_TAPS], along_y[MOST_TAPS];
    window_weights(factors.x, factors.y, decay, reach_x, along_x);
    window_weights(factors.z, factors.w, decay + 2 * reach_x + 1, reach_y, along_y);

    for (int t = 0; t <= 2 * reach_y; ++t) {
        const long row = (long)(nearest_y - reach_y + t + grid.row_zero) * grid.columns;
        const long first = row + nearest_x - reach_x + grid.column_zero;
        for (int s = 0; s <= 2 * reach_x; ++s) {
            const double8 weight = along_x[s] * along_y[t];
            __global const double *cell = stack + (first + s) * 16 * BLOCKS;
            UNROLL for (int b = 0; b < BLOCKS; ++b) {
                re[b] = fma(weight, vload8(b, cell), re[b]);
                im[b] = fma(weight, vload8(BLOCKS + b, cell), im[b]);
            }
        }
    }
}
