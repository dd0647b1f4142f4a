/* The device's own peak: chains of fused multiply-adds that nothing but arithmetic bounds.
 *
 *   out  double[work-items]   keeps the compiler from removing the work
 *
 * Each step is 8 independent double8 FMAs, enough to hide their latency: 128 floating-point operations.
 */
__kernel void peak(const int steps, __global double *out) {
    const double8 scale = 0.999999, shift = 1e-6 * (double)get_global_id(0);
    double8 a = 0.0, b = 1.0, c = 2.0, d = 3.0, e = 4.0, f = 5.0, g = 6.0, h = 7.0;
    for (int i = 0; i < steps; ++i) {
        a = fma(a, scale, shift);
        b = fma(b, scale, shift);
        c = fma(c, scale, shift);
        d = fma(d, scale, shift);
        e = fma(e, scale, shift);
        f = fma(f, scale, shift);
        g = fma(g, scale, shift);
        h = fma(h, scale, shift);
    }
    const double8 sum = ((a + b) + (c + d)) + ((e + f) + (g + h));
    out[get_global_id(0)] = sum.s0 + sum.s1 + sum.s2 + sum.s3 + sum.s4 + sum.s5 + sum.s6 + sum.s7;
}
