/* |P|^2 from the min/max-normalised DFT terms of Single 2014, alg. 1 and 3: a neighbourhood of coefficients, weighed
 * and summed for every term, then the Taylor series.
 *
 *   P(f; s) = sum_n (s H)^n / n! F_n(f),   F_n(f) = sum_(i,j) weight_x(i) weight_y(j) D_n[j, i],   s = k w
 *   i = a - reach .. a + reach,  a = floor(f / df): the anchor of eq. 1.7, not the nearest coefficient
 *   D_n    the DFT of i^n t^n, t = h/H, over the number of samples; stored as (D - least) / range, eq. 1.1
 *
 * Stored numbers are float, all sums double: what is lost is what the normalisation lost. gaussian_power weighs by the
 * window's transform at the neighbours' distances (alg. 3), sinc_power by the transform of one patch between its DFT
 * coefficients (1.5.3). One work-item, one pair of a direction and a wavelength, whose neighbourhood must lie within
 * the stored terms. Arguments:
 *
 * gaussian_power
 *   terms    float[rows][columns][2][DOUBLES * BLOCKS]   1   normalised terms: real and imaginary parts, n side by side
 *   extrema  double[2][2][DOUBLES * BLOCKS]   1     least, then range, of real and imaginary parts; 0 beyond the last
 *   grid     TermsGrid                        1/um  frequencies of the terms
 *   reach_x  int                              1     coefficients on either side of the anchor, along x
 *   reach_y  int                              1     and along y
 *   pairs    double4[pairs]                   1/um  fx, fy; s H in radians; fourth unused
 *   power    double[pairs]                    1     result: |P|^2, 1 of a mirror at f = 0
 *
 * sinc_power
 *   terms    float[rows][columns][2][DOUBLES * BLOCKS]   1   as of gaussian_power
 *   extrema  double[2][2][DOUBLES * BLOCKS]   1     as of gaussian_power
 *   grid     TermsGrid                        1/um  as of gaussian_power
 *   reach_x  int                              1     as of gaussian_power
 *   reach_y  int                              1     as of gaussian_power
 *   pairs    double4[pairs]                   1/um  as of gaussian_power
 *   power    double[pairs]                    1     result: |P|^2
 *
 * Set by the host: BLOCKS of DOUBLES terms; MOST_TAPS, which bounds 2 reach + 1.
 */

#include "common.cl"
#define CELL (PARTS * DOUBLES * BLOCKS) /* floats of a coefficient, all terms */
#define SAME 1e-12 /* spacings: nearer than this, sin(pi d) / (pi d) is 1 to the rounding of double */

typedef struct {
    double dfx, dfy;          /* spacing of the DFT's frequencies, 1/um */
    double sigma_x, sigma_y;  /* sigma_f of the window's transform in those spacings */
    int columns;              /* of the terms */
    int row_zero, column_zero; /* of f = 0 */
} TermsGrid;

/* exp(-d^2 / (2 sigma_f^2)) at the neighbours of `position`, both in spacings */
static void gaussian(const double position, const double sigma, const int reach, double *weight) {
    const double first = floor(position) - reach - position;
    for (int i = 0; i <= 2 * reach; ++i) weight[i] = exp(-0.5 * (first + i) * (first + i) / (sigma * sigma));
}

/* sin(pi d) / (pi d), d = first + i: the sine only changes its sign from one neighbour to the next */
static void sinc(const double position, const int reach, double *weight) {
    const double first = floor(position) - reach - position;
    double sine = sinpi(first);
    for (int i = 0; i <= 2 * reach; ++i, sine = -sine) {
        const double d = first + i;
        weight[i] = fabs(d) < SAME ? 1.0 : sine / (M_PI * d);
    }
}

/* |sum_n (s H)^n / n! F_n|^2 with the weights of both axes */
static double taylor_power(__global const float *terms, __global const double *extrema, const TermsGrid grid,
                           const int reach_x, const int reach_y, const double4 pair, const double *along_x,
                           const double *along_y) {
    const int first_row = (int)floor(pair.y / grid.dfy) - reach_y + grid.row_zero;
    const int first_column = (int)floor(pair.x / grid.dfx) - reach_x + grid.column_zero;
    double8 re[BLOCKS], im[BLOCKS];
    for (int b = 0; b < BLOCKS; ++b) {
        re[b] = 0.0;
        im[b] = 0.0;
    }
    double weights = 0.0;
    for (int t = 0; t <= 2 * reach_y; ++t) {
        __global const float *row = terms + ((long)(first_row + t) * grid.columns + first_column) * CELL;
        for (int s = 0; s <= 2 * reach_x; ++s) {
            const double weight = along_x[s] * along_y[t];
            __global const float *cell = row + (long)s * CELL;
            weights += weight;
            UNROLL for (int b = 0; b < BLOCKS; ++b) {
                re[b] = fma((double8)weight, convert_double8(vload8(b, cell)), re[b]);
                im[b] = fma((double8)weight, convert_double8(vload8(BLOCKS + b, cell)), im[b]);
            }
        }
    }

    double series[DOUBLES * BLOCKS];
    series[0] = 1.0;
    for (int n = 1; n < DOUBLES * BLOCKS; ++n) series[n] = series[n - 1] * pair.z / n;
    /* D = least + range * stored at every neighbour: their weighed sum takes both once */
    double8 sum_re = 0.0, sum_im = 0.0;
    UNROLL for (int b = 0; b < BLOCKS; ++b) {
        const double8 factor = vload8(b, series);
        sum_re += factor * (vload8(b, extrema) * weights + vload8(2 * BLOCKS + b, extrema) * re[b]);
        sum_im += factor * (vload8(BLOCKS + b, extrema) * weights + vload8(3 * BLOCKS + b, extrema) * im[b]);
    }
    const double p_re = total(sum_re), p_im = total(sum_im);
    return p_re * p_re + p_im * p_im;
}

__kernel void gaussian_power(__global const float *terms, __global const double *extrema, const TermsGrid grid,
                             const int reach_x, const int reach_y, __global const double4 *pairs,
                             __global double *power) {
    const double4 pair = pairs[get_global_id(0)];
    double along_x[MOST_TAPS], along_y[MOST_TAPS];
    gaussian(pair.x / grid.dfx, grid.sigma_x, reach_x, along_x);
    gaussian(pair.y / grid.dfy, grid.sigma_y, reach_y, along_y);
    power[get_global_id(0)] = taylor_power(terms, extrema, grid, reach_x, reach_y, pair, along_x, along_y);
}

__kernel void sinc_power(__global const float *terms, __global const double *extrema, const TermsGrid grid,
                         const int reach_x, const int reach_y, __global const double4 *pairs,
                         __global double *power) {
    const double4 pair = pairs[get_global_id(0)];
    double along_x[MOST_TAPS], along_y[MOST_TAPS];
    sinc(pair.x / grid.dfx, reach_x, along_x);
    sinc(pair.y / grid.dfy, reach_y, along_y);
    power[get_global_id(0)] = taylor_power(terms, extrema, grid, reach_x, reach_y, pair, along_x, along_y);
}
