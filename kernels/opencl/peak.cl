/* The device's own peak: chains of fused multiply-adds that nothing but arithmetic bounds. A step continues CHAINS
 * independent chains, enough to hide the latency of a multiply-add on two units; a vector takes one register, so that
 * chains and their two factors stay in 16 registers, the least that a processor with vectors of 32 bytes has. Arguments:
 *
 * peak
 *   steps  int                1   of every chain
 *   out    REAL[work-items]   1   result: keeps the compiler from removing the work
 *
 * Set by the host: REAL and LANES, one vector register of the device; CHAINS.
 */

#include "common.cl"
#define VECTOR NAME(REAL, LANES)

__kernel void peak(const int steps, __global REAL *out) {
    const VECTOR scale = (REAL)0.999, shift = (REAL)1e-3 * (REAL)get_global_id(0);
    VECTOR chain[CHAINS], sum = 0;
    UNROLL for (int j = 0; j < CHAINS; ++j) chain[j] = j;
    ROLLED for (int i = 0; i < steps; ++i)
        UNROLL for (int j = 0; j < CHAINS; ++j) chain[j] = fma(chain[j], scale, shift);
    UNROLL for (int j = 0; j < CHAINS; ++j) sum += chain[j];
    const REAL *lane = (const REAL *)&sum;
    REAL all = 0;
    for (int i = 0; i < LANES; ++i) all += lane[i];
    out[get_global_id(0)] = all;
}
