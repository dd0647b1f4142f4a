/* Exact |P|^2 at given directions and wavelengths, from the Chebyshev stack: of one window, or the mean over several.
 *
 *   exp(i s h) = sum_n (2 - [n = 0]) i^n J_n(s H) T_n(h / H),  s = k w     (Jacobi-Anger)
 *   P(f; s)    = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f)                   F_n of T_n(h/H), Dhillon et al. 2014, eq. 8
 *   F_n(f)     = sum_c g(fx - phi_c) sum_r g(fy - psi_r) H_n[r, c],  g(d) = exp(-d^2 / (2 sigma_f^2))
 *
 * Directions come in lines of one v, u ascending: at a wavelength all of a line have one fy. So the inner sum, over the
 * rows of a column, is made once and serves every direction whose window holds that column; the outer one is each
 * direction's own. Directions that share f, such as two opposite views of a normal light, share that one too.
 *
 * The mean over several windows is a sum of |P|^2 over modes, each with real factors of the coefficients
 * (polar_power_spectrum.cl has the equation); one window is one mode whose factors are 1. A stack that is too large may
 * come in parts of its terms: every part but the last adds P of each mode to `amplitude`, the last one makes |P|^2.
 *
 * Every work-item takes its share of all lines and groups of WAVES wavelengths. Arguments; taps = 2 * reach + 1:
 *
 * exact_power
 *   stack       double[rows][columns][2][DOUBLES * blocks]  1  H_n: real and imaginary part, terms n side by side,
 *                                                              zero beyond the last
 *   decay       double[taps_x + taps_y]     1     g at j spacings, j = -reach .. reach, of x, then of y
 *   grid        Grid                        1/um  frequencies of the stack and the window's width
 *   mode_x      double[columns][modes_x]    1     factor of each mode at the stack's columns
 *   mode_y      double[rows][modes_y]       1     and at its rows
 *   modes_x     int                         1     modes along x
 *   modes_y     int                         1     and along y
 *   blocks      int                         1     vectors of terms in this part of the stack
 *   before      int                         1     vectors of terms in the parts before it
 *   all_blocks  int                         1     vectors of terms in all parts
 *   reach_x     int                         1     coefficients on either side of the nearest, along x
 *   reach_y     int                         1     and along y
 *   lines       int                         1     of directions
 *   groups      int                         1     of WAVES wavelengths
 *   first       int[lines + 1]              1     where each line's directions begin
 *   directions  double4[directions]         1     u >= 0, v, w, turn: -1 for what was (-u, -v), else 1
 *   place       int[directions]             1     the row of `power` of each direction
 *   lambda_um   double[WAVES * groups]      um    wavelengths, padded to whole groups
 *   half_range  double                      um    H
 *   fx_max      double                      1/um  Nyquist limit of the scan along x
 *   fy_max      double                      1/um  and along y
 *   scratch     double[work-items][room]    1     of `line_power`
 *   room        long                            1     WAVES * 2 * DOUBLES * ((taps_x + modes_x) * modes_y * blocks + 2 * all_blocks)
 *   amplitude   double[directions][groups][WAVES][modes_y * modes_x][2]   1   P of each mode, of the parts before; none
 *                                                                            where one part is all
 *   power       double[directions][WAVES * groups]   1   result: |P|^2, 1 for a mirror at f = 0; NaN beyond the Nyquist
 *                                                        limits
 *
 * Set by the host: MOST_TAPS, which no taps may exceed. Nothing here is a constant of a config, so the program is
 * compiled once.
 */

#include "common.cl"
#define WAVES 4   /* wavelengths of a group: one vector of 32 bytes */
#define MOST_VECTORS 2 /* of terms that are summed at once: both parts fill whole pairs */
#define W_AHEAD 2 /* values of w whose Bessel functions are made at once: WAVES of each fill a vector of 64 bytes */
#define SMALLEST_Z 1e-12    /* 2 / z must stay finite; J_n(z) is J_n(0) there, to the rounding of double */
#define TINY 1e-280         /* where Miller's recurrence starts: what it grows by must not overflow */

WINDOW_WEIGHTS(weights_of_peak, double4, double)

/* g(d - j df), j = -reach .. reach, for four d. */
static APART void window_weights(const double4 d, const double df, const double inverse_2_variance,
                                 __global const double *decay, const int reach, double4 *weight) {
    const double4 ratio = exp(2.0 * df * inverse_2_variance * d), peak = exp(-inverse_2_variance * d * d);
    weights_of_peak(peak, ratio, decay, reach, weight);
}

/* Adds sum_i weight[WAVES (m count + i)] cell[i * stride + k] of each mode m, i < taps, k < DOUBLES * vectors, to
 * sum[m]. What is loaded serves all modes. */
static INLINE void add(__global const double *cell, const long stride, const double *weight, const int count,
                       const int taps, const int modes, const int vectors, double8 (*sum)[MOST_VECTORS]) {
    ROLLED for (int i = 0; i < taps; ++i, cell += stride, weight += WAVES)
        UNROLL for (int v = 0; v < vectors; ++v) {
            const double8 here = vload8(v, cell);
            UNROLL for (int m = 0; m < modes; ++m)
                sum[m][v] = fma((double8)weight[WAVES * m * count], here, sum[m][v]);
        }
}

/* sum_i weights[m count + i] cells[(start + i) % count], i < count, of each mode m, for cells of `width` doubles,
 * `stride` apart; `lane` picks the wavelength's weights. Sums of modes are `apart`; those of `vectors` of terms and all
 * modes stay in registers. */
static INLINE void sums(__global const double *cells, const long stride, const int start, const double4 *weights,
                        const int lane, const int count, const int width, const int modes, const int vectors,
                        __global double *sum, const long apart) {
    const double *weight = (const double *)weights + lane;
    ROLLED for (int k = 0; k < width; k += DOUBLES * vectors) {
        double8 found[MODES][MOST_VECTORS];
        UNROLL for (int m = 0; m < modes; ++m) UNROLL for (int v = 0; v < vectors; ++v) found[m][v] = 0.0;
        add(cells + start * stride + k, stride, weight, count, count - start, modes, vectors, found);
        add(cells + k, stride, weight + WAVES * (count - start), count, start, modes, vectors, found);
        UNROLL for (int m = 0; m < modes; ++m)
            UNROLL for (int v = 0; v < vectors; ++v) vstore8(found[m][v], v, sum + m * apart + k);
    }
}

static APART void sums_of_one(__global const double *cells, const long stride, const int start, const double4 *weights,
                              const int lane, const int count, const int width, __global double *sum) {
    sums(cells, stride, start, weights, lane, count, width, 1, MOST_VECTORS, sum, 0);
}

static APART void sums_of_all(__global const double *cells, const long stride, const int start, const double4 *weights,
                              const int lane, const int count, const int width, __global double *sum,
                              const long apart) {
    sums(cells, stride, start, weights, lane, count, width, MODES, 1, sum, apart);
}

/* The weighted sums of as many modes as there are: all MODES at once, or one after the other. */
static void weighted_sums(__global const double *cells, const long stride, const int start, const double4 *weights,
                          const int lane, const int count, const int width, const int modes, __global double *sum,
                          const long apart) {
    if (modes == MODES) sums_of_all(cells, stride, start, weights, lane, count, width, sum, apart);
    else ROLLED for (int m = 0; m < modes; ++m)
        sums_of_one(cells, stride, start, weights + m * count, lane, count, width, sum + m * apart);
}

/* The first order at which J_n(z) < 1e-16. J_n decays like an Airy function of (n - z) / z^(1/3) from n = z on; the
 * factors were measured for z to 5000. */
static double8 miller_start(const double8 z) { return ceil(z + 11.0 * cbrt(z) + 5.0); }

/* (2 - [n = 0]) J_n(-z), n < terms, for eight z >= 0, into factors[lane][terms]: Miller's downward recurrence from
 * where J_n is negligible, normalised by J_0 + 2 J_2 + 2 J_4 + ... = 1. Each lane starts at its own order, so small z
 * cannot overflow. `j` holds DOUBLES * terms. */
static APART void bessel_factors(double8 z, const int terms, __global double *j, __global double *factors) {
    z = fmax(z, (double8)SMALLEST_Z);
    const double8 start = miller_start(z);
    const double8 two_over_z = 2.0 / z;
    const double4 later = fmax(start.lo, start.hi);
    const int top = (int)fmax(fmax(later.x, later.y), fmax(later.z, later.w));
    double8 above = 0.0, here = 0.0, norm = 0.0;
    ROLLED for (int n = top + 1; n < terms; ++n) vstore8((double8)0.0, n, j);
    ROLLED for (int n = top; n >= 0; --n) {
        /* here = J_n up to a factor */
        const double8 below = (double)(n + 1) * two_over_z * here - above;
        above = here;
        here = select(below, (double8)TINY, convert_long8(start == (double8)n));
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

/* sum_n i^n factors_n F_n, F_n conjugated where turn is -1: h is real, so P(-f; s) has conjugate coefficients. */
static APART double2 amplitude_of(__global const double *f_n, __global const double *factors, const int blocks,
                                  const double turn) {
    double8 re = 0.0, im = 0.0;
    ROLLED for (int b = 0; b < blocks; ++b) {
        const double8 factor = vload8(b, factors);
        re = fma(factor, vload8(b, f_n), re);
        im = fma(factor, vload8(blocks + b, f_n), im);
    }
    im *= turn;
    /* i^n = cosine + i sine */
    const double8 cosine = (double8)(1, 0, -1, 0, 1, 0, -1, 0), sine = (double8)(0, 1, 0, -1, 0, 1, 0, -1);
    return (double2)(total(cosine * re - sine * im), total(cosine * im + sine * re));
}

/* The sum over modes of |P|^2, with P of the parts before; 0 before the last part, while P is kept. */
static APART double power_of(__global const double *f_n, __global const double *factors, const int blocks,
                             const int modes, const double turn, const int is_first, const int is_last,
                             __global double *amplitude) {
    double sum = 0.0;
    ROLLED for (int m = 0; m < modes; ++m) {
        double2 p = amplitude_of(f_n + m * PARTS * DOUBLES * blocks, factors, blocks, turn);
        if (!is_first) p += vload2(m, amplitude);
        if (is_last) sum += dot(p, p);
        else vstore2(p, m, amplitude);
    }
    return sum;
}

/* w of the first direction after `d` that has another than it, or the same where none has. */
static double next_w(__global const double4 *directions, const int d, const int end) {
    ROLLED for (int e = d + 1; e < end; ++e)
        if (directions[e].z != directions[d].z) return directions[e].z;
    return directions[d].z;
}

/* The weights of each mode, [mode][tap]: those of the window times the mode's factors from `first` on. */
static APART void mode_weights(const double4 *weight, const int4 first, __global const double *mode, const int modes,
                               const int taps, double4 *weights) {
    ROLLED for (int m = 0; m < modes; ++m)
        ROLLED for (int t = 0; t < taps; ++t) {
            const int4 at = (first + t) * modes + m;
            weights[m * taps + t] = weight[t] * (double4)(mode[at.x], mode[at.y], mode[at.z], mode[at.w]);
        }
}

/* F_n of one wavelength and every pair of modes, from the window that begins at (row, column): sums over rows of the
 * columns from `fresh` on, which the ring does not hold yet, then the sum over all of the window's columns. Column c is
 * at c % taps_x of the ring, of which each mode along y has one. */
static APART void gather(__global const double *stack, const int columns, const int width, const int row,
                         const int column, const int fresh, const int taps_x, const int taps_y, const int modes_x,
                         const int modes_y, const double4 *along_x, const double4 *along_y, const int lane,
                         __global double *ring, __global double *f_n) {
    ROLLED for (int c = max(column, fresh); c < column + taps_x; ++c)
        weighted_sums(stack + ((long)row * columns + c) * width, (long)columns * width, 0, along_y, lane, taps_y, width,
                      modes_y, ring + c % taps_x * width, (long)taps_x * width);
    ROLLED for (int m = 0; m < modes_y; ++m)
        weighted_sums(ring + m * taps_x * width, width, column % taps_x, along_x, lane, taps_x, width, modes_x,
                      f_n + m * modes_x * width, width);
}

/* What is known of the stack's modes and of the part of its terms that is at hand. */
typedef struct {
    int modes_x, modes_y, blocks, before, all_blocks, reach_x, reach_y;
} Part;

/* One line, directions[begin .. end - 1], at the wavelengths of a group. `scratch` holds for each wavelength a ring of
 * columns whose rows are summed, and F_n; then what multiplies F_n, for W_AHEAD values of w; and J_n. */
static APART void line_power(__global const double *stack, __global const double *decay, const Grid grid,
                             __global const double *mode_x, __global const double *mode_y, const Part part,
                             const int begin, const int end, __global const double4 *directions,
                             __global const int *place, const double4 lambda_um, const double half_range,
                             const double fx_max, const double fy_max, __global double *scratch,
                             __global double *amplitude, __global double *power, const long stride) {
    const int taps_x = 2 * part.reach_x + 1, taps_y = 2 * part.reach_y + 1, terms = DOUBLES * part.all_blocks;
    const int width = PARTS * DOUBLES * part.blocks, modes = part.modes_x * part.modes_y;
    const int ring_size = part.modes_y * taps_x * width;
    __global double *const rings = scratch, *const f_n = rings + WAVES * ring_size;
    __global double *const factors = f_n + WAVES * modes * width, *const j_n = factors + W_AHEAD * WAVES * terms;
    double4 window[MOST_TAPS], along_x[MODES * MOST_TAPS], along_y[MODES * MOST_TAPS];

    const double4 fy = directions[begin].y / lambda_um, nearest_y = rint(fy / grid.dfy);
    window_weights(fy - nearest_y * grid.dfy, grid.dfy, grid.inverse_2_variance, decay + taps_x, part.reach_y, window);
    const int4 inside_y = convert_int4(fabs(fy) <= fy_max);
    const int4 row = select((int4)0, convert_int4(nearest_y) - part.reach_y + grid.row_zero, inside_y);
    mode_weights(window, row, mode_y, part.modes_y, taps_y, along_y);
    int4 fresh = 0;
    int known = 0;
    /* w is negative and u is not: nothing is known yet */
    double w_known[W_AHEAD] = {1.0, 1.0}, u_before = -1.0;

    ROLLED for (int d = begin; d < end; ++d) {
        const double u = directions[d].x, w = directions[d].z, turn = directions[d].w;
        if (w == w_known[1 - known]) known = 1 - known;
        if (w != w_known[known]) {
            /* two w at once: the recurrence waits for its own results */
            known = 0;
            w_known[0] = w;
            w_known[1] = next_w(directions, d, end);
            const double4 k_half_range = 2.0 * M_PI / lambda_um * half_range;
            bessel_factors((double8)(k_half_range * fabs(w_known[0]), k_half_range * fabs(w_known[1])), terms, j_n,
                           factors);
        }
        const double4 fx = u / lambda_um, nearest_x = rint(fx / grid.dfx);
        const int4 inside = inside_y & convert_int4(fx <= fx_max);
        const int4 column =
            select((int4)0, convert_int4(nearest_x) - part.reach_x + grid.column_zero, convert_int4(fx <= fx_max));
        const int same_f = u == u_before;
        if (!same_f) {
            window_weights(fx - nearest_x * grid.dfx, grid.dfx, grid.inverse_2_variance, decay, part.reach_x, window);
            mode_weights(window, column, mode_x, part.modes_x, taps_x, along_x);
        }
        double found[WAVES];
        ROLLED for (int lane = 0; lane < WAVES; ++lane) {
            found[lane] = NAN;
            if (!((const int *)&inside)[lane]) continue;
            if (!same_f)
                gather(stack, grid.columns, width, ((const int *)&row)[lane], ((const int *)&column)[lane],
                       ((const int *)&fresh)[lane], taps_x, taps_y, part.modes_x, part.modes_y, along_x, along_y, lane,
                       rings + lane * ring_size, f_n + lane * modes * width);
            found[lane] = power_of(f_n + lane * modes * width,
                                   factors + (WAVES * known + lane) * terms + DOUBLES * part.before, part.blocks, modes,
                                   turn, part.before == 0, part.before + part.blocks == part.all_blocks,
                                   amplitude + (place[d] * stride + lane) * modes * PARTS);
        }
        vstore4(vload4(0, found), 0, power + place[d] * stride);
        fresh = column + taps_x;
        u_before = u;
    }
}

__kernel void exact_power(__global const double *stack, __global const double *decay, const Grid grid,
                          __global const double *mode_x, __global const double *mode_y, const int modes_x,
                          const int modes_y, const int blocks, const int before, const int all_blocks,
                          const int reach_x, const int reach_y, const int lines, const int groups,
                          __global const int *first, __global const double4 *directions, __global const int *place,
                          __global const double *lambda_um, const double half_range, const double fx_max,
                          const double fy_max, __global double *scratch, const long room, __global double *amplitude,
                          __global double *power) {
    const long item = get_global_id(0), items = get_global_size(0), tasks = (long)lines * groups;
    const Part part = {modes_x, modes_y, blocks, before, all_blocks, reach_x, reach_y};
    /* neighbouring wavelengths of a line ask for the same coefficients, one after the other */
    ROLLED for (long task = item * tasks / items; task < (item + 1) * tasks / items; ++task) {
        const int line = task / groups, group = task % groups;
        line_power(stack, decay, grid, mode_x, mode_y, part, first[line], first[line + 1], directions, place,
                   vload4(group, lambda_um), half_range, fx_max, fy_max, scratch + item * room,
                   amplitude + WAVES * group * modes_x * modes_y * PARTS, power + WAVES * group, WAVES * groups);
    }
}
