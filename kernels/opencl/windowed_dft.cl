/* Windowed DFT of the terms of a series: Dhillon et al. 2014, eq. 8. Included by kernels; it has none of its own.
 *
 *   F_n(f) = sum_(c,r) H_n[r, c] exp(-|f - (phi_c, psi_r)|^2 / (2 sigma_f^2))
 *
 * H_n[r, c] are the DFT coefficients of the n-th term (t^n, or T_n(t)) of a real height field, held for all n side by
 * side so that one vector load serves several terms:
 *
 *   stack   double[rows][columns][2][DOUBLES * BLOCKS]   real and imaginary part; n, zero beyond the last
 *           psi = (row - row_zero) dfy, phi = (column - column_zero) dfx, 1/um
 *   decay   double[taps_x + taps_y]   the window at j spacings from its peak, taps = 2 * reach + 1, of x, then of y
 *
 * Given at launch: reach_x and reach_y, coefficients taken on either side of the nearest. Set by the host: BLOCKS,
 * vectors of DOUBLES terms; MOST_TAPS, which bounds taps.
 */

#include "common.cl"
#define CELL (PARTS * DOUBLES * BLOCKS) /* doubles of a coefficient, all terms */

WINDOW_WEIGHTS(window_weights, double, double)

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
    /* the peak and the ratio of either axis */
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
            __global const double *cell = stack + (first + s) * CELL;
            UNROLL for (int b = 0; b < BLOCKS; ++b) {
                re[b] = fma(weight, vload8(b, cell), re[b]);
                im[b] = fma(weight, vload8(BLOCKS + b, cell), im[b]);
            }
        }
    }
}
