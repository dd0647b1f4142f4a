/* Spectral integration as a linear operator from E(r, s) to a ring of the polar table, the same for every azimuth.
 *
 *   I(rho, phi, w) = sum_l weights[l] E(rho / l, phi, 2 pi |w| / l)      in X, Y and Z (DESIGN's XYZ without C cos ti)
 *   E(r, s)        = sum_(a, j) L_a(r) C_j(s) E(r_a, s_j)                L Lagrange's polynomials on ORDER nodes about r,
 *                                                                         C cardinal functions of Chebyshev nodes
 *   I(rho, phi, w) = sum_k T_k(2 |w| / w_max - 1) table[k],  w_max = sqrt(4 - rho^2)
 *
 * Set by the host: ORDER (even); S_NODES; W_TERMS, a multiple of 4; OUT = 3 W_TERMS; GROUPS of GROUP outputs,
 * a multiple of 4.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")

/* r of node i; E(-r, phi) = E(r, phi + pi), so nodes go on below 0 */
static double node(__global const double *radius, const int i) { return i < 0 ? -radius[-i] : radius[i]; }

/* the first of the ORDER nodes about r >= 0, kept within the last; may be negative */
static int first_node(__global const double *radius, const int radii, const double r) {
    int low = 0, high = radii - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (radius[middle] <= r) low = middle; else high = middle;
    }
    return min(low - (ORDER / 2 - 1), radii - ORDER);
}

static void lagrange(__global const double *radius, const int first, const double r, float *weight) {
    for (int a = 0; a < ORDER; ++a) {
        double product = 1.0;
        for (int b = 0; b < ORDER; ++b)
            if (b != a) product *= (r - node(radius, first + b)) / (node(radius, first + a) - node(radius, first + b));
        weight[a] = product;
    }
}

/* The operator of each ring. One work-item, one ring.
 *
 *   radius    double[radii]          r_a, 1/um, ascending from 0
 *   rho       double[rings]
 *   lambda    double[], weights float4[]    um; X, Y, Z: the nodes of every ring's quadrature
 *   nodes     int2[rings]            where a ring's quadrature begins, and its length
 *   extent    int4[rings]            first radius (may be negative), radii, where its matrix begins in units of OUT,
 *                                    where its rows of `reflectance` begin
 *   reflectance  float[...][W_TERMS] of the material at each wavelength of a ring and each node of w; 1 outside metals
 *   cardinal  float[S_NODES][S_NODES]    C_j = sum_k cardinal[k][j] T_k
 *   cosine    float4[W_TERMS][W_TERMS / 4]   Chebyshev coefficients from values at the nodes, [w node][term]
 *   w_node    float4[W_TERMS / 4]    nodes of w in [0, 1], shares of w_max
 *   matrix    float[...][GROUPS][radii of the ring * S_NODES][GROUP]
 */
__kernel void build_operator(__global const double *radius, const int radii, __global const double *rho,
                             __global const double *lambda, __global const float4 *weights, __global const int2 *nodes,
                             __global const int4 *extent, __global const float *reflectance, const float s_max, __global const float *cardinal,
                             __global const float4 *cosine, __global const float4 *w_node, __global float *matrix) {
    const int ring = get_global_id(0), steps = extent[ring].y * S_NODES;
    __global float *out = matrix + (long)extent[ring].z * GROUP * GROUPS;
    for (long k = 0; k < (long)steps * GROUP * GROUPS; ++k) out[k] = 0.0f;
    const float w_max = sqrt(fmax(4.0 - rho[ring] * rho[ring], 0.0));

    for (int l = nodes[ring].x; l < nodes[ring].x + nodes[ring].y; ++l) {
        const double r = rho[ring] / lambda[l];
        __global const float *reflected = reflectance + (long)(extent[ring].w + l - nodes[ring].x) * W_TERMS;
        const int first = first_node(radius, radii, r);
        float along_r[ORDER];
        lagrange(radius, first, r, along_r);

        /* T_k at every node of w */
        const float scale = 2.0f * 2.0f * (float)M_PI * w_max / (float)lambda[l] / s_max;
        float4 T[S_NODES][W_TERMS / 4];
        for (int b = 0; b < W_TERMS / 4; ++b) {
            const float4 z = scale * w_node[b] - 1.0f;
            T[0][b] = 1.0f;
            T[1][b] = z;
            for (int k = 2; k < S_NODES; ++k) T[k][b] = 2.0f * z * T[k - 1][b] - T[k - 2][b];
        }
        for (int j = 0; j < S_NODES; ++j) {
            float value[W_TERMS];
            for (int b = 0; b < W_TERMS / 4; ++b) {
                float4 sum = 0.0f;
                for (int k = 0; k < S_NODES; ++k) sum = fma((float4)cardinal[k * S_NODES + j], T[k][b], sum);
                vstore4(sum * vload4(b, reflected), b, value);
            }
            float4 term[W_TERMS / 4];
            for (int b = 0; b < W_TERMS / 4; ++b) {
                term[b] = 0.0f;
                for (int n = 0; n < W_TERMS; ++n) term[b] = fma((float4)value[n], cosine[n * (W_TERMS / 4) + b], term[b]);
            }
            for (int a = 0; a < ORDER; ++a) {
                const int step = (first + a - extent[ring].x) * S_NODES + j;
                const float share[3] = {weights[l].x * along_r[a], weights[l].y * along_r[a], weights[l].z * along_r[a]};
                UNROLL for (int q = 0; q < OUT / 4; ++q) {
                    /* four outputs, never of two groups: GROUP is a multiple of 4 */
                    __global float *at = out + ((long)(4 * q / GROUP) * steps + step) * GROUP + 4 * q % GROUP;
                    vstore4(fma((float4)share[4 * q / W_TERMS], term[q % (W_TERMS / 4)], vload4(0, at)), 0, at);
                }
            }
        }
    }
}

/* The table of sixteen azimuths of one ring and one group of outputs.
 *
 *   spectrum  float[2 * tiles][radii][S_NODES][16]   E, as polar_spectrum.cl writes it
 *   table     float[rings][OUT][16 * 2 * tiles]      Chebyshev coefficients over w: X's, then Y's, then Z's
 */
__kernel void apply_operator(__global const float *spectrum, const int radii, __global const int4 *extent,
                             __global const float *matrix, __global float *table) {
    const int ring = get_global_id(0), tile = get_global_id(1), tiles = get_global_size(1), group = get_global_id(2);
    const int first = extent[ring].x, count = extent[ring].y;
    __global const float *row = matrix + ((long)extent[ring].z * GROUPS + (long)group * count * S_NODES) * GROUP;
    __global const float *here = spectrum + (long)tile * radii * S_NODES * 16;
    __global const float *opposite = spectrum + (long)((tile + tiles / 2) % tiles) * radii * S_NODES * 16;
    float16 sum[GROUP];
    UNROLL for (int o = 0; o < GROUP; ++o) sum[o] = 0.0f;
    for (int i = first; i < first + count; ++i) {
        __global const float *power = i < 0 ? opposite - (long)i * S_NODES * 16 : here + (long)i * S_NODES * 16;
        for (int j = 0; j < S_NODES; ++j) {
            const float16 e = vload16(j, power);
            UNROLL for (int o = 0; o < GROUP; ++o) sum[o] = fma((float16)row[o], e, sum[o]);
            row += GROUP;
        }
    }
    UNROLL for (int o = 0; o < GROUP; ++o)
        if (group * GROUP + o < OUT)
            vstore16(sum[o], tile, table + ((long)ring * OUT + group * GROUP + o) * tiles * 16);
}
