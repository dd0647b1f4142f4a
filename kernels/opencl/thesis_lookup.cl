/* |P|^2 from the min/max-normalised DFT terms of Single 2014, alg. 1 and 3: a neighbourhood of coefficients, weighed
 * and summed for every term, then the Taylor series.
 *
 *   P(f; s) = sum_n (s H)^n / n! F_n(f),   F_n(f) = sum_(i,j) weight_x(i) weight_y(j) D_n[j, i],   s = k w
 *   i = a - reach .. a + reach,  a = floor(f / df): the anchor of eq. 1.7, not the nearest coefficient
 *   D_n    the DFT of i^n t^n, t = h/H, over the number of samples; stored as (D - least) / range, eq. 1.1
 *
 *   terms    float[rows][columns][2][8 * BLOCKS]   normalised terms: real and imaginary parts, n side by side;
 *                                                  row_zero and column_zero are those of f = 0
 *   extrema  double[2][2][8 * BLOCKS]              least, then range, of real and imaginary parts; 0 beyond the last
 *   pairs    double4[pairs]                        fx, fy in 1/um, s H in radians, fourth unused
 *   power    double[pairs]                         |P|^2, 1 of a mirror at f = 0
 *
 * Stored numbers are float, all sums double: what is lost is what the normalisation lost. One work-item, one pair of
 * a direction and a wavelength, whose neighbourhood must lie within the stored terms.
 *
 * Given at launch: reach_x and reach_y. Set by the host: BLOCKS of 8 terms; MOST_TAPS, which bounds 2 reach + 1.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")

typedef struct {
    double dfx, dfy;          /* spacing of the DFT's frequencies, 1/um */
    double sigma_x, sigma_y;  /* sigma_f of the window's transform in those spacings */
    int columns, row_zero, column_zero;
} Grid;

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
        weight[i] = fabs(d) < 1e-12 ? 1.0 : sine / (M_PI * d);
    }
}

static double total(const double8 x) {
    const double4 half_sum = x.lo + x.hi;
    return (half_sum.x + half_sum.y) + (half_sum.z + half_sum.w);
}

/* |sum_n (s H)^n / n! F_n|^2 with the weights of both axes */
static double taylor_power(__global const float *terms, __global const double *extrema, const Grid grid,
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
        __global const float *row = terms + ((long)(first_row + t) * grid.columns + first_column) * 16 * BLOCKS;
        for (int s = 0; s <= 2 * reach_x; ++s) {
            const double weight = along_x[s] * along_y[t];
            __global const float *cell = row + (long)s * 16 * BLOCKS;
            weights += weight;
            UNROLL for (int b = 0; b < BLOCKS; ++b) {
                re[b] = fma((double8)weight, convert_double8(vload8(b, cell)), re[b]);
                im[b] = fma((double8)weight, convert_double8(vload8(BLOCKS + b, cell)), im[b]);
            }
        }
    }

    double series[8 * BLOCKS];
    series[0] = 1.0;
    for (int n = 1; n < 8 * BLOCKS; ++n) series[n] = series[n - 1] * pair.z / n;
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

/* Single 2014, alg. 3: the window's transform at the neighbours' distances */
__kernel void gaussian_power(__global const float *terms, __global const double *extrema, const Grid grid,
                             const int reach_x, const int reach_y, __global const double4 *pairs,
                             __global double *power) {
    const double4 pair = pairs[get_global_id(0)];
    double along_x[MOST_TAPS], along_y[MOST_TAPS];
    gaussian(pair.x / grid.dfx, grid.sigma_x, reach_x, along_x);
    gaussian(pair.y / grid.dfy, grid.sigma_y, reach_y, along_y);
    power[get_global_id(0)] = taylor_power(terms, extrema, grid, reach_x, reach_y, pair, along_x, along_y);
}

/* Single 2014, 1.5.3: the transform of one patch between its DFT coefficients */
__kernel void sinc_power(__global const float *terms, __global const double *extrema, const Grid grid,
                         const int reach_x, const int reach_y, __global const double4 *pairs,
                         __global double *power) {
    const double4 pair = pairs[get_global_id(0)];
    double along_x[MOST_TAPS], along_y[MOST_TAPS];
    sinc(pair.x / grid.dfx, reach_x, along_x);
    sinc(pair.y / grid.dfy, reach_y, along_y);
    power[get_global_id(0)] = taylor_power(terms, extrema, grid, reach_x, reach_y, pair, along_x, along_y);
}
