/* The device's memory bandwidth, by McCalpin's triad: out = a + scale b on arrays that no cache holds. One work-item,
 * VECTORS vectors side by side: two reads and one write of 64 bytes each. Arguments:
 *
 * triad
 *   a      float16[work-items * VECTORS]   1   read
 *   b      float16[work-items * VECTORS]   1   read
 *   scale  float                           1   factor of b
 *   out    float16[work-items * VECTORS]   1   result
 *
 * Set by the host: VECTORS.
 */
__kernel void triad(__global const float16 *a, __global const float16 *b, const float scale, __global float16 *out) {
    const long first = (long)get_global_id(0) * VECTORS;
    for (long i = first; i < first + VECTORS; ++i) out[i] = fma((float16)scale, b[i], a[i]);
}
