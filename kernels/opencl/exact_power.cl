/* Exact |P|^2 at given directions and wavelengths, from the Chebyshev stack.
 *
 *   exp(i s h) = sum_n (2 - [n = 0]) i^n J_n(s H) T_n(h / H),  s = k w        (Jacobi-Anger)
 *   P(f; s)    = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f)                      F_n of T_n(h/H), Dhillon et al. 2014, eq. 8
 *   F_n(f)     = sum_s g(fx - phi_s) sum_t g(fy - psi_t) H_n[s, t],  g(d) = exp(-d^2 / (2 sigma_f^2))
 *
 * Directions come in lines of one v, u ascending: at a wavelength all of a line have one fy. So the inner sum, over the
 * rows of a column, is made once and serves every direction whose window holds that column; the outer one is each
 * direction's own. Directions that share f, such as two opposite views of a normal light, share that one too.
 *
 *   stack       double[rows][columns][2][8 * blocks]  H_n: real and imaginary part, terms n side by side, zero beyond the last
 *   decay       double[TAPS_X], then [TAPS_Y]         g at j spacings, j = -reach .. reach; TAPS = 2 * reach + 1
 *   first       int[lines + 1]                        where each line's directions begin
 *   directions  double4[directions]                   u >= 0, v, w, turn: -1 for what was (-u, -v), else 1
 *   place       int[directions]                       row of `power` for each direction
 *   lambda      double[4 * groups]                    um, padded to whole vectors
 *   power       double[directions][4 * groups]        |P|^2, 1 for a mirror at f = 0; NaN beyond the scan's band
 *   fx_max, fy_max                                    the scan's band, 1/um
 *   scratch     double[work-items][16 * blocks * (4 * TAPS_X + 12)]
 *
 * Every work-item takes its share of all lines and groups of four wavelengths. The host sets MOST_TAPS, which no TAPS may
 * exceed; nothing here is a constant of a config, so the program is compiled once.
 */

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif
#define ROLLED _Pragma("nounroll")  /* copies of a loop's body would cost compiling time and win nothing */
/* a function that is compiled by itself, called where its loops begin: the compiler's time grows faster than a body's length */
#define APART __attribute__((noinline))

typedef struct {
    double dfx, dfy;            /* spacing of the DFT's frequencies, 1/um */
    double inverse_2_variance;  /* 1 / (2 sigma_f^2), um^2 */
    int columns, row_zero, column_zero;
} Grid;

/* g(d - j df), j = -reach .. reach, for four d: one exponential for all, as g(d - j df) = g(d) exp(d df / sigma_f^2)^j g(j df) */
static APART void window_weights(const double4 d, const double df, const double inverse_2_variance, __global const double *decay,
                           const int reach, double4 *weight) {
    const double4 ratio = exp(2.0 * df * inverse_2_variance * d), inverse = 1.0 / ratio;
    double4 up = exp(-inverse_2_variance * d * d), down = up;
    weight[reach] = up;
    ROLLED for (int j = 1; j <= reach; ++j) {
        up *= ratio;
        down *= inverse;
        weight[reach + j] = up * decay[reach + j];
        weight[reach - j] = down * decay[reach - j];
    }
}

/* Adds sum_i weight[4 i] cell[i * stride + k], i < count, to low, k < 8, and to high, 8 <= k < 16 */
static void add(__global const double *cell, const long stride, const double *weight, const int count, double8 *low,
                double8 *high) {
    ROLLED for (int i = 0; i < count; ++i, cell += stride) {
        *low = fma((double8)weight[4 * i], vload8(0, cell), *low);
        *high = fma((double8)weight[4 * i], vload8(1, cell), *high);
    }
}

/* sum_i weights[i] cells[(start + i) % count], i < count, for cells of `width` doubles, `stride` apart; `lane` picks the weights */
static void weighted_sum(__global const double *cells, const long stride, const int start, const double4 *weights,
                         const int lane, const int count, const int width, __global double *sum) {
    const double *weight = (const double *)weights + lane;
    ROLLED for (int k = 0; k < width; k += 16) {
        double8 low = 0.0, high = 0.0;
        add(cells + start * stride + k, stride, weight, count - start, &low, &high);
        add(cells + k, stride, weight + 4 * (count - start), start, &low, &high);
        vstore8(low, 0, sum + k);
        vstore8(high, 1, sum + k);
    }
}

/* (2 - [n = 0]) J_n(-z), n < terms, for eight z >= 0, into factors[lane][terms]: Miller's downward recurrence from where
 * J_n is below 1e-16, normalised by J_0 + 2 J_2 + 2 J_4 + ... = 1. Each lane starts at its own order, so small z cannot
 * overflow. `j` holds 8 * terms. */
static APART void bessel_factors(double8 z, const int terms, __global double *j, __global double *factors) {
    z = fmax(z, (double8)1e-12);
    const double8 start = ceil(z + 11.0 * cbrt(z) + 5.0);
    const double8 two_over_z = 2.0 / z;
    const double4 later = fmax(start.lo, start.hi);
    const int top = (int)fmax(fmax(later.x, later.y), fmax(later.z, later.w));
    double8 above = 0.0, here = 0.0, norm = 0.0;
    ROLLED for (int n = top + 1; n < terms; ++n) vstore8((double8)0.0, n, j);
    ROLLED for (int n = top; n >= 0; --n) {
        /* here = J_n up to a factor */
        const double8 below = (double)(n + 1) * two_over_z * here - above;
        above = here;
        here = select(below, (double8)1e-280, convert_long8(start == (double8)n));
        if (n < terms) vstore8(here, n, j);
        if ((n & 1) == 0) norm += (n == 0) ? here : 2.0 * here;
    }
    /* J_n(-z) = (-1)^n J_n(z) */
    const double8 even = 2.0 / norm, odd = -even;
    ROLLED for (int n = 0; n < terms; n += 4) {
        const double8 a = (n == 0 ? 0.5 : 1.0) * even * vload8(n, j), b = odd * vload8(n + 1, j);
        const double8 c = even * vload8(n + 2, j), d = odd * vload8(n + 3, j);
        vstore4((double4)(a.s0, b.s0, c.s0, d.s0), 0, factors + n);
        vstore4((double4)(a.s1, b.s1, c.s1, d.s1), 0, factors + terms + n);
        vstore4((double4)(a.s2, b.s2, c.s2, d.s2), 0, factors + 2 * terms + n);
        vstore4((double4)(a.s3, b.s3, c.s3, d.s3), 0, factors + 3 * terms + n);
        vstore4((double4)(a.s4, b.s4, c.s4, d.s4), 0, factors + 4 * terms + n);
        vstore4((double4)(a.s5, b.s5, c.s5, d.s5), 0, factors + 5 * terms + n);
        vstore4((double4)(a.s6, b.s6, c.s6, d.s6), 0, factors + 6 * terms + n);
        vstore4((double4)(a.s7, b.s7, c.s7, d.s7), 0, factors + 7 * terms + n);
    }
}

static double total(const double8 x) {
    const double4 half_sum = x.lo + x.hi;
    return (half_sum.x + half_sum.y) + (half_sum.z + half_sum.w);
}

/* |sum_n i^n factors_n F_n|^2, F_n conjugated where turn is -1: h is real, so P(-f; s) has the conjugate coefficients */
static APART double power_of(__global const double *f_n, __global const double *factors, const int blocks, const double turn) {
    double8 re = 0.0, im = 0.0;
    ROLLED for (int b = 0; b < blocks; ++b) {
        const double8 factor = vload8(b, factors);
        re = fma(factor, vload8(b, f_n), re);
        im = fma(factor, vload8(blocks + b, f_n), im);
    }
    im *= turn;
    /* i^n = cosine + i sine */
    const double8 cosine = (double8)(1, 0, -1, 0, 1, 0, -1, 0), sine = (double8)(0, 1, 0, -1, 0, 1, 0, -1);
    const double p_re = total(cosine * re - sine * im), p_im = total(cosine * im + sine * re);
    return p_re * p_re + p_im * p_im;
}

/* w of the first direction after `d` that has another than it, or the same where none has */
static double next_w(__global const double4 *directions, const int d, const int end) {
    ROLLED for (int e = d + 1; e < end; ++e)
        if (directions[e].z != directions[d].z) return directions[e].z;
    return directions[d].z;
}

/* F_n of one wavelength, from the window that begins at (row, column): sums over rows of the columns from `fresh` on, which
 * the ring does not hold yet, then the sum over all of the window's columns. Column c stands at c % taps of the ring. */
static APART void gather(__global const double *stack, const int columns, const int width, const int row, const int column,
                   const int fresh, const int taps_x, const int taps_y, const double4 *along_x, const double4 *along_y,
                   const int lane, __global double *ring, __global double *f_n) {
    ROLLED for (int c = max(column, fresh); c < column + taps_x; ++c)
        weighted_sum(stack + ((long)row * columns + c) * width, (long)columns * width, 0, along_y, lane, taps_y, width,
                     ring + c % taps_x * width);
    weighted_sum(ring, width, column % taps_x, along_x, lane, taps_x, width, f_n);
}

/* One line, directions[begin .. end - 1], at four wavelengths. */
static APART void line_power(__global const double *stack, __global const double *decay, const Grid grid, const int blocks,
                       const int reach_x, const int reach_y, const int begin, const int end,
                       __global const double4 *directions, __global const int *place, const double4 lambda,
                       const double half_range, const double fx_max, const double fy_max, __global double *scratch,
                       __global double *power, const long stride) {
    const int taps_x = 2 * reach_x + 1, taps_y = 2 * reach_y + 1, width = 16 * blocks, terms = 8 * blocks;
    /* of each wavelength: a ring of columns whose rows are summed; F_n; and what multiplies it, for two w */
    __global double *const rings = scratch, *const f_n = rings + 4 * taps_x * width;
    __global double *const factors = f_n + 4 * width, *const j_n = factors + 8 * terms;
    double4 along_x[MOST_TAPS], along_y[MOST_TAPS];

    const double4 fy = directions[begin].y / lambda, nearest_y = rint(fy / grid.dfy);
    window_weights(fy - nearest_y * grid.dfy, grid.dfy, grid.inverse_2_variance, decay + taps_x, reach_y, along_y);
    const int4 row = convert_int4(nearest_y) - reach_y + grid.row_zero;
    int4 fresh = 0;
    int known = 0;
    double w_known[2] = {1.0, 1.0}, u_before = -1.0;

    ROLLED for (int d = begin; d < end; ++d) {
        const double u = directions[d].x, w = directions[d].z, turn = directions[d].w;
        if (w == w_known[1 - known]) known = 1 - known;
        if (w != w_known[known]) {
            /* two w at once: the recurrence waits for its own results */
            known = 0;
            w_known[0] = w;
            w_known[1] = next_w(directions, d, end);
            const double4 k = 2.0 * M_PI / lambda * half_range;
            bessel_factors((double8)(k * fabs(w_known[0]), k * fabs(w_known[1])), terms, j_n, factors);
        }
        const double4 fx = u / lambda, nearest_x = rint(fx / grid.dfx);
        const int4 column = convert_int4(nearest_x) - reach_x + grid.column_zero;
        const int4 inside = convert_int4(fx <= fx_max && fabs(fy) <= fy_max);
        const int same_f = u == u_before;
        if (!same_f)
            window_weights(fx - nearest_x * grid.dfx, grid.dfx, grid.inverse_2_variance, decay, reach_x, along_x);
        double found[4];
        ROLLED for (int lane = 0; lane < 4; ++lane) {
            found[lane] = NAN;
            if (!((const int *)&inside)[lane]) continue;
            if (!same_f)
                gather(stack, grid.columns, width, ((const int *)&row)[lane], ((const int *)&column)[lane],
                       ((const int *)&fresh)[lane], taps_x, taps_y, along_x, along_y, lane, rings + lane * taps_x * width,
                       f_n + lane * width);
            found[lane] = power_of(f_n + lane * width, factors + (4 * known + lane) * terms, blocks, turn);
        }
        vstore4((double4)(found[0], found[1], found[2], found[3]), 0, power + place[d] * stride);
        fresh = column + taps_x;
        u_before = u;
    }
}

__kernel void exact_power(__global const double *stack, __global const double *decay, const Grid grid,
                             const int blocks, const int reach_x, const int reach_y, const int lines, const int groups,
                             __global const int *first, __global const double4 *directions, __global const int *place,
                             __global const double *lambda, const double half_range, const double fx_max,
                             const double fy_max, __global double *scratch, __global double *power) {
    const long item = get_global_id(0), items = get_global_size(0), tasks = (long)lines * groups;
    __global double *const own = scratch + item * 16 * blocks * (4 * (2 * reach_x + 1) + 12);
    /* neighbouring wavelengths of a line ask for the same coefficients, one after the other */
    ROLLED for (long task = item * tasks / items; task < (item + 1) * tasks / items; ++task) {
        const int line = task / groups, group = task % groups;
        line_power(stack, decay, grid, blocks, reach_x, reach_y, first[line], first[line + 1], directions, place,
                   vload4(group, lambda), half_range, fx_max, fy_max, own, power + 4 * group, 4 * groups);
    }
}
