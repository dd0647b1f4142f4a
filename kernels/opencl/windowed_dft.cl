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
 * Set by the host: BLOCKS, vectors of 8 terms; REACH_X and REACH_Y, coefficients taken on either side of the nearest.
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

#define WEIGHTS(REACH) (8 * ((2 * (REACH) + 8) / 8))

/* exp(-(f - s df)^2 / (2 sigma_f^2)) for the 2 reach + 1 coefficients s about the nearest: the window is separable. */
static void window_weights(const double f, const double df, const double inverse_2_variance, const int first,
                           const int vectors, double *weight) {
    const double8 lane = (double8)(0, 1, 2, 3, 4, 5, 6, 7);
    for (int i = 0; i < vectors; ++i) {
        const double8 d = f - (lane + (double)(first + 8 * i)) * df;
        vstore8(exp(-d * d * inverse_2_variance), i, weight);
    }
}

/* F_n(fx, fy) for all terms, into re and im (BLOCKS vectors each). (fx, fy) must lie within the stack. */
static void windowed_dft(__global const double *stack, const Grid grid, const double fx, const double fy,
                         double8 *re, double8 *im) {
    UNROLL for (int b = 0; b < BLOCKS; ++b) {
        re[b] = 0.0;
        im[b] = 0.0;
    }
    const int first_x = (int)rint(fx / grid.dfx) - REACH_X, first_y = (int)rint(fy / grid.dfy) - REACH_Y;
    double along_x[WEIGHTS(REACH_X)], along_y[WEIGHTS(REACH_Y)];
    window_weights(fx, grid.dfx, grid.inverse_2_variance, first_x, WEIGHTS(REACH_X) / 8, along_x);
    window_weights(fy, grid.dfy, grid.inverse_2_variance, first_y, WEIGHTS(REACH_Y) / 8, along_y);

    for (int t = 0; t <= 2 * REACH_Y; ++t) {
        const long row = (long)(first_y + t + grid.row_zero) * grid.columns + first_x + grid.column_zero;
        for (int s = 0; s <= 2 * REACH_X; ++s) {
            const double8 weight = along_x[s] * along_y[t];
            __global const double *cell = stack + (row + s) * 16 * BLOCKS;
            UNROLL for (int b = 0; b < BLOCKS; ++b) {
                re[b] = fma(weight, vload8(b, cell), re[b]);
                im[b] = fma(weight, vload8(BLOCKS + b, cell), im[b]);
            }
        }
    }
}
