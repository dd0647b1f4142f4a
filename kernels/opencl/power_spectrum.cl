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

__kernel void power_spectrum(__global const double *stack, const Grid grid, __global const double4 *uvw,
                             __global const double *lambda, const double half_range, const double fx_max,
                             const double fy_max, __global double *power) {
    const int direction = get_global_id(0), group = get_global_id(1);
    const double8 lambdas = vload8(group, lambda);
    double8 bessel_n[TERMS];
    bessel(2.0 * M_PI / lambdas * fabs(uvw[direction].z) * half_range, bessel_n);

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
        windowed_dft(stack, grid, fx, fy, re, im);

        double f_re[8 * BLOCKS], f_im[8 * BLOCKS];
        UNROLL for (int b = 0; b < BLOCKS; ++b) {
            vstore8(re[b], b, f_re);
            vstore8(im[b], b, f_im);
        }
        /* w < 0 makes s negative: J_n(-z) = (-1)^n J_n(z), so odd terms change sign */
        double p_re = 0.0, p_im = 0.0;
        for (int n = 0; n < TERMS; ++n) {
            const double odd = (n & 1) ? -1.0 : 1.0;
            const double a = (n == 0 ? 1.0 : 2.0) * odd * ((const double *)&bessel_n[n])[lane];
            const double x = a * f_re[n], y = turn * a * f_im[n];
            p_re += (n & 2) ? ((n & 1) ? y : -x) : ((n & 1) ? -y : x);
            p_im += (n & 2) ? ((n & 1) ? -x : -y) : ((n & 1) ? x : y);
        }
        *out = p_re * p_re + p_im * p_im;
    }
}
