/* The device's own peak: chains of fused multiply-adds that nothing but arithmetic bounds. Each step is 8 independent
 * FMAs of whole vectors, enough to hide their latency: 16 LANES floating-point operations. Arguments:
 *
 * peak
 *   steps  int                1   of every chain
 *   out    REAL[work-items]   1   result: keeps the compiler from removing the work
 *
 * Set by the host: REAL and LANES, a vector of 64 bytes.
 */

#include "common.cl"
#define VECTOR NAME(REAL, LANES)

__kernel void peak(const int steps, __global REAL *out) {
    const VECTOR scale = (REAL)0.999, shift = (REAL)1e-3 * (REAL)get_global_id(0);
    VECTOR a = 0, b = 1, c = 2, d = 3, e = 4, f = 5, g = 6, h = 7;
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
    const VECTOR sum = ((a + b) + (c + d)) + ((e + f) + (g + h));
    const REAL *lane = (const REAL *)&sum;
    REAL all = 0;
    for (int i = 0; i < LANES; ++i) all += lane[i];
    out[get_global_id(0)] = all;
}
