/* Tables I_p(u, v) of the spectrally integrated Taylor series: Dhillon et al. 2014, eq. 11 and 12.
 *
 *   I_p(u, v) = sum_l weights[l] sum_(n + m = p) F_n(u/l, v/l) . F_m(u/l, v/l) k^p / (n! m!)
 *
 * With G_n = (i k H)^n / n! F_n, where F_n transforms (h/H)^n, eq. 12's dot products are those of the 2-vectors G_n.
 * One work-item, one node. Arguments; taps = 2 * reach + 1:
 *
 * taylor_table
 *   stack        double[rows][columns][2][DOUBLES * BLOCKS]   1   of windowed_dft.cl
 *   decay        double[taps_x + taps_y]                1     of windowed_dft.cl
 *   grid         Grid                                   1/um  frequencies of the stack and the window's width
 *   terms        int                                    1     N + 1
 *   reach_x      int                                    1     coefficients on either side of the nearest, along x
 *   reach_y      int                                    1     and along y
 *   uv           double2[nodes]                         1     (u, v) of each node, |(u, v)| <= 2, u >= 0
 *   first        int                                    1     the first node of this launch
 *   lambda_um    double[wavelengths]                    um    of the quadrature
 *   series       double[wavelengths][2][DOUBLES * BLOCKS]   1   (i k H)^n / n!, real and imaginary part
 *   weights      double4[wavelengths]                   1     of X, Y and Z; fourth unused
 *   wavelengths  int                                    1     of the quadrature
 *   fx_max       double                                 1/um  Nyquist limit of the scan along x: none is added beyond
 *   fy_max       double                                 1/um  and along y
 *   table        double[nodes][CHANNELS][2 * DOUBLES * BLOCKS]   1   result: I_p, p = 0 .. 2 N, then zeros
 *
 * Set by the host: BLOCKS = ceil(terms / DOUBLES), for x, y and z stay in registers; MOST_TAPS, which bounds taps.
 */

#include "windowed_dft.cl"
#define TERMS (DOUBLES * BLOCKS) /* of the series, to whole vectors; products of two have twice as many */

__kernel void taylor_table(__global const double *stack, __global const double *decay, const Grid grid,
                           const int terms, const int reach_x, const int reach_y, __global const double2 *uv,
                           const int first, __global const double *lambda_um, __global const double *series,
                           __global const double4 *weights, const int wavelengths, const double fx_max,
                           const double fy_max, __global double *table) {
    const int node = first + get_global_id(0);
    double8 x[2 * BLOCKS], y[2 * BLOCKS], z[2 * BLOCKS];
    UNROLL for (int b = 0; b < 2 * BLOCKS; ++b) x[b] = y[b] = z[b] = 0.0;

    /* G_n, with zeros before and after for the convolution */
    double g_re[3 * TERMS], g_im[3 * TERMS];
    double *const re_n = g_re + TERMS, *const im_n = g_im + TERMS;
    UNROLL for (int b = 0; b < 3 * BLOCKS; ++b) {
        vstore8((double8)0.0, b, g_re);
        vstore8((double8)0.0, b, g_im);
    }

    /* how often n = 4 b + i counts in p = 8 b + lane: twice below the middle p / 2, once on it, never above */
    const double8 near_middle[4] = {(double8)(1, 2, 2, 2, 2, 2, 2, 2), (double8)(0, 0, 1, 2, 2, 2, 2, 2),
                                    (double8)(0, 0, 0, 0, 1, 2, 2, 2), (double8)(0, 0, 0, 0, 0, 0, 1, 2)};

    for (int l = 0; l < wavelengths; ++l) {
        const double fx = uv[node].x / lambda_um[l], fy = uv[node].y / lambda_um[l];
        if (fabs(fx) > fx_max || fabs(fy) > fy_max) continue;

        double8 re[BLOCKS], im[BLOCKS];
        windowed_dft(stack, decay, grid, reach_x, reach_y, fx, fy, re, im);

        /* G_n = series_n F_n */
        __global const double *series_re = series + l * PARTS * TERMS, *series_im = series_re + TERMS;
        UNROLL for (int b = 0; b < BLOCKS; ++b) {
            const double8 c_re = vload8(b, series_re), c_im = vload8(b, series_im);
            vstore8(c_re * re[b] - c_im * im[b], b, re_n);
            vstore8(c_re * im[b] + c_im * re[b], b, im_n);
        }

        /* sum over n + m = p of G_n . G_m, eight p at a time: pairs n < m count twice */
        UNROLL for (int b = 0; b < 2 * BLOCKS; ++b) {
            double8 product = 0.0;
            for (int n = max(0, 8 * (b - BLOCKS) + 1); n < min(terms, 4 * b); ++n) {
                product = fma((double8)re_n[n], vload8(0, re_n + 8 * b - n), product);
                product = fma((double8)im_n[n], vload8(0, im_n + 8 * b - n), product);
            }
            product *= 2.0;
            UNROLL for (int i = 0; i < 4; ++i) {
                const int n = 4 * b + i;
                product = fma(near_middle[i] * re_n[n], vload8(0, re_n + 8 * b - n), product);
                product = fma(near_middle[i] * im_n[n], vload8(0, im_n + 8 * b - n), product);
            }
            x[b] = fma((double8)weights[l].x, product, x[b]);
            y[b] = fma((double8)weights[l].y, product, y[b]);
            z[b] = fma((double8)weights[l].z, product, z[b]);
        }
    }

    __global double *out = table + (long)get_global_id(0) * CHANNELS * 2 * TERMS;
    for (int b = 0; b < 2 * BLOCKS; ++b) {
        vstore8(x[b], b, out);
        vstore8(y[b], b, out + 2 * TERMS);
        vstore8(z[b], b, out + 4 * TERMS);
    }
}
