/* Exact |P|^2 at given directions and wavelengths, from the Chebyshev stack.
 *
 *   exp(i s h) = sum_n (2 - [n = 0]) i^n J_n(s H) T_n(h / H),  s = k w        (Jacobi-Anger)
 *   P(f; s)    = sum_n (2 - [n = 0]) i^n J_n(s H) F_n(f)                      F_n of T_n(h/H), eq. 8
 *
 *   uvw      double4[directions]                    (u, v, w), fourth unused
 *   lambda   double[8 * groups]                     um, padded to whole vectors
 *   power    double[directions][8 * groups]         |P|^2, 1 for a mirror at f = 0; NaN beyond the scan's band
 *   fx_max, fy_max                                  the scan's band, 1/um
 *
 * TERMS and BLOCKS = ceil(TERMS / 8) are set by the host. One work-item, one direction and eight wavelengths.
 */

/* J_n(z), n < TERMS, for eight z >= 0: Miller's downward recurrence from where J_n is below 1e-16, normalised by
 * J_0 + 2 J_2 + 2 J_4 + ... = 1. Each lane starts at its own order, so small z cannot overflow. */
static void bessel(double8 z, double8 *j) {
    z = fmax(z, (double8)1e-12);
    const double8 start = ceil(z + 9.0 * cbrt(z) + 14.0);
    const double8 two_over_z = 2.0 / z;
    const double top = fmax(fmax(fmax(start.s0, start.s1), fmax(start.s2, start.s3)),
                            fmax(fmax(start.s4, start.s5), fmax(start.s6, start.s7)));
    double8 above = 0.0, here = 0.0, norm = 0.0;
    for (int n = 0; n < TERMS; ++n) j[n] = 0.0;
    for (int n = (int)top; n >= 0; --n) {
        /* here = J_n up to a factor */
        const double8 below = (double)(n + 1) * two_over_z * here - above;
        above = here;
        here = select(below, (double8)1e-280, convert_long8(start == (double8)n));
        if (n < TERMS) j[n] = here;
        if ((n & 1) == 0) norm += (n == 0) ? here : 2.0 * here;
    }
    for (int n = 0; n < TERMS; ++n) j[n] /= norm;
}

static double total(const double8 x) {
    const double4 half_sum = x.lo + x.hi;
    return (half_sum.x + half_sum.y) + (half_sum.z + half_sum.w);
}

__kernel void power_spectrum(__global const double *stack, __global const double *decay, const Grid grid,
                             __global const double4 *uvw, __global const double *lambda, const double half_range, const double fx_max,
                             const double fy_max, __global double *power) {
    const int direction = get_global_id(0), group = get_global_id(1);
    const double8 lambdas = vload8(group, lambda);
    double8 bessel_n[TERMS];
    bessel(2.0 * M_PI / lambdas * fabs(uvw[direction].z) * half_range, bessel_n);

    /* (2 - [n = 0]) J_n(s H) by lane, terms side by side; w < 0 makes s negative, and J_n(-z) = (-1)^n J_n(z) */
    double factors[8][8 * BLOCKS];
    for (int n = 0; n < 8 * BLOCKS; ++n)
        for (int lane = 0; lane < 8; ++lane)
            factors[lane][n] = n < TERMS ? (n == 0 ? 1.0 : (n & 1) ? -2.0 : 2.0) * ((double *)&bessel_n[n])[lane] : 0.0;
    /* i^n = cosine + i sine */
    const double8 cosine = (double8)(1, 0, -1, 0, 1, 0, -1, 0), sine = (double8)(0, 1, 0, -1, 0, 1, 0, -1);

    for (int lane = 0; lane < 8; ++lane) {
        const int l = 8 * group + lane;
        __global double *out = power + (long)direction * 8 * get_global_size(1) + l;
        /* h is real, so P(-f; s) has the conjugate coefficients: the stack holds one half plane, fx >= 0 */
        const double turn = uvw[direction].x < 0.0 ? -1.0 : 1.0;
        const double fx = turn * uvw[direction].x / lambda[l], fy = turn * uvw[direction].y / lambda[l];
        if (fx > fx_max || fabs(fy) > fy_max) {
            *out = NAN;
            continue;
        }
        double8 re[BLOCKS], im[BLOCKS];
        windowed_dft(stack, decay, grid, fx, fy, re, im);

        double8 sum_re = 0.0, sum_im = 0.0;
        UNROLL for (int b = 0; b < BLOCKS; ++b) {
            const double8 factor = vload8(b, factors[lane]), conjugated = turn * im[b];
            sum_re = fma(factor, cosine * re[b] - sine * conjugated, sum_re);
            sum_im = fma(factor, cosine * conjugated + sine * re[b], sum_im);
        }
        const double p_re = total(sum_re), p_im = total(sum_im);
        *out = p_re * p_re + p_im * p_im;
    }
}
