/* Spectral integration as a linear operator from E(r, s) to a ring of the polar table, the same for every azimuth.
 * docs/spectral_operator.md derives it, with a drawing of the (r, s) plane.
 *
 *   I(rho, phi, w) = sum_l weights[l] E(rho / l, phi, 2 pi |w| / l)   in X, Y, Z (docs/conventions.md, less C cos ti)
 *   E(r, s)        = sum_(a, j) L_a(r) C_j(s) E(r_a, s_j)             L Lagrange's polynomials on ORDER radii about r,
 *                                                                     C cardinal functions of Chebyshev nodes
 *   I(rho, phi, w) = sum_k T_k(2 |w| / w_max - 1) table[k],  w_max = sqrt(4 - rho^2)
 *
 * At a ring and a w, E is wanted along one line through the origin, r = rho kappa and s = 2 pi |w| kappa with
 * kappa = 1 / l. It is taken there at points kappa_p, once for all wavelengths, which are interpolated from it:
 *
 *   G(p, w) = sum_j C_j(2 pi |w| kappa_p) E(rho kappa_p, s_j)
 *   I(w)    = sum_p point_weights[p] G(p, w),   point_weights[p] = sum_l weights[l] L_p(1 / l)
 *
 * Where points are chosen on radii of E (rho kappa_p = r_a) nothing is interpolated over r; where they are a ring's
 * wavelengths, nothing along the line. A ring t rho has the same line at t w, where its wavelengths lie at t / l: rings
 * that follow each other share G, as a group, at nodes w_m of its first ring; what I is at nodes of a ring's own
 * follows from the polynomial through these.
 *
 * Several lights, each with its own observer and reflectance, have weights of their own over the same points: a group
 * serves one light, or all of those whose points are equal, and G is evaluated once for them.
 *
 * build_operator makes the weights of each group; one work-item, one group. apply_operator makes the tables of one group
 * at the azimuths of a tile and those half a turn on; one work-item, one group and one tile of half a turn. Arguments:
 *
 * build_operator
 *   groups         Group[groups]                      1     of rings
 *   rings          Ring[lights][rings]                1     of each light's table
 *   first_radius   int[points]                        1     the radius of a point, or the first of the ORDER about it,
 *                                                           which may be negative
 *   radius         double[radii]                      1/um  r_a, ascending from 0
 *   rho            double[rings]                      1     |(u, v)|
 *   stretch        double[lights][rings]              1     t: rho of the ring over that of its group's first
 *   kappa          double[points]                     1/um  kappa_p, ascending in each group
 *   lambda_um      double[nodes]                      um    wavelengths of every quadrature, ascending
 *   weights        float4[nodes]                      1     their weights in X, Y, Z; fourth unused
 *   reflectance    float[...][w_terms]                1     of the material, at each wavelength of a ring and each node
 *                                                           w_m of its group; 1 outside metals
 *   to_series      float[s_nodes][s_nodes]            1     C_j = sum_k to_series[k][j] T_k
 *   w_node         float[groups][w_terms]             1     w_m, |w| of the group's first ring
 *   s_max          float                              1/um  where the nodes of E in s end
 *   ring_count     int                                1     rings of a table
 *   s_nodes        int                                1     nodes of E in s
 *   w_terms        int                                1     nodes w_m; a multiple of W_LANES
 *   lagrange_r     float[points][ORDER]               1     result: L_a of a point between radii
 *   cardinal_s     float[points][s_nodes][w_terms]    1     result: C_j at every w_m
 *   point_weights  float[...][CHANNELS][w_terms]      1     result: for every light's ring, of all points of its group
 *   used           int2[lights][rings]                1     result: the first point of its group that a ring takes
 *                                                           from, and the one after the last
 *
 * apply_operator
 *   spectrum       float[...][radii][s_nodes][LANES]  1     E, as polar_power_spectrum.cl writes it
 *   radii          int                                1     of E
 *   pairs          int2[tiles]                        1     where a tile of azimuths and the one that is made with it
 *                                                           lie in E: half a turn on where a ring takes radii below 0
 *   groups         Group[groups]                      1     as of build_operator
 *   rings          Ring[lights][rings]                1     as of build_operator
 *   first_radius   int[points]                        1     as of build_operator
 *   lagrange_r     float[points][ORDER]               1     as build_operator wrote it
 *   cardinal_s     float[points][s_nodes][w_terms]    1     as build_operator wrote it
 *   point_weights  float[...][CHANNELS][w_terms]      1     as build_operator wrote it
 *   used           int2[lights][rings]                1     as build_operator wrote it
 *   ring_count     int                                1     rings of a table
 *   s_nodes        int                                1     nodes of E in s
 *   w_terms        int                                1     nodes w_m, and terms of the table
 *   to_w_terms     float[lights][rings][w_terms][w_terms]   1   Chebyshev coefficients over a ring's w from values at
 *                                                           its group's nodes, [term][node]
 *   is_summed      int                                1     whether the terms are summed at one w of each texel
 *   own_x          float[lights][rings][HALVES * tiles][LANES]   1   argument of T_k at that w; unread where they are
 *                                                           not
 *   table          float[lights][rings][CHANNELS][w_terms][HALVES * tiles][LANES]   1   result; w_terms is 1 where
 *                                                           summed
 *
 * Set by the host: LANES, 16, azimuths of a tile; WIDTH, floats of a register; ORDER (even); MOST_RINGS of a group;
 * MOST_S_NODES and MOST_W_TERMS, which bound what a work-item keeps: a group's lights times w_terms are at most
 * MOST_W_TERMS; W_BLOCK (1, 2 or 4), nodes of w whose sums stay in registers; XYZ_VECTORS (1, 2 or 4), registers of
 * azimuths whose X, Y and Z do.
 */

#include "common.cl"
#define CHUNK 24  /* points whose G waits in the nearest cache: 8 nodes of w take 24 KiB */
#define REGISTER NAME(float, WIDTH)
#define W_PAIR 2  /* terms in w that are summed at once: eight sums of 8 floats hide an addition's latency */
#define W_LANES 4 /* nodes of w in a vector of build_operator */

typedef struct {
    int first, points;   /* among the points of all groups */
    int on_radii;        /* whether they lie on radii of E */
    int on_nodes;        /* whether they are the wavelengths themselves, from the last to the first, of its one ring */
    int ring, rings;     /* the first, and how many */
    int light, lights;   /* likewise */
} Group;

typedef struct {
    int point_weights;   /* where its rows of `point_weights` begin, one for every point of its group */
    int nodes, count;    /* where its quadrature begins, and its length */
    int reflectance;     /* where its rows of `reflectance` begin */
} Ring;

/* The row of a group's q-th ring, light by light, in arrays of every light's rings. */
static int row_of(const Group group, const int q, const int ring_count) {
    return (group.light + q / group.rings) * ring_count + group.ring + q % group.rings;
}

/* r of a radius by its index; E(-r, phi) = E(r, phi + pi), so radii go on below 0. */
static double radius_at(__global const double *radius, const int i) { return i < 0 ? -radius[-i] : radius[i]; }

/* Of Lagrange's polynomials on the ORDER nodes `x`, the factors that do not depend on where they are evaluated. */
static APART void lagrange_factors(const double *x, double *factor) {
    double below[ORDER];
    ROLLED for (int a = 0; a < ORDER; ++a) below[a] = 1.0;
    ROLLED for (int b = 0; b < ORDER; ++b)
        UNROLL for (int a = 0; a < ORDER; ++a) below[a] *= a == b ? 1.0 : x[a] - x[b];
    UNROLL for (int a = 0; a < ORDER; ++a) factor[a] = 1.0 / below[a];
}

/* Lagrange's polynomials on the ORDER nodes `x`, at `at`: products of the differences before each node and after it. */
static APART void lagrange(const double *x, const double *factor, const double at, float *weight) {
    double before[ORDER], after = 1.0;
    before[0] = 1.0;
    UNROLL for (int a = 1; a < ORDER; ++a) before[a] = before[a - 1] * (at - x[a - 1]);
    UNROLL for (int a = ORDER - 1; a >= 0; --a) {
        weight[a] = factor[a] * before[a] * after;
        after *= at - x[a];
    }
}

/* L_a of a point between radii, r away from the origin. */
static APART void radial_weights(__global const double *radius, const int first_radius, const double r,
                                 __global float *lagrange_r) {
    double x[ORDER], factor[ORDER];
    float weight[ORDER];
    ROLLED for (int a = 0; a < ORDER; ++a) x[a] = radius_at(radius, first_radius + a);
    lagrange_factors(x, factor);
    lagrange(x, factor, r, weight);
    ROLLED for (int a = 0; a < ORDER; ++a) lagrange_r[a] = weight[a];
}

/* C_j of a point at every w_m; `scale` w_node = 2 s / s_max. */
static APART void cardinal_functions(const float scale, __global const float *w_node, __global const float *to_series,
                                     const int s_nodes, const int w_terms, __global float *cardinal_s) {
    ROLLED for (int m = 0; m < w_terms; m += W_LANES) {
        const float4 z = scale * vload4(0, w_node + m) - 1.0f;
        float4 T[MOST_S_NODES];
        T[0] = 1.0f;
        T[1] = z;
        ROLLED for (int k = 2; k < s_nodes; ++k) T[k] = 2.0f * z * T[k - 1] - T[k - 2];
        ROLLED for (int j = 0; j < s_nodes; ++j) {
            float4 sum = 0.0f;
            ROLLED for (int k = 0; k < s_nodes; ++k) sum = fma((float4)to_series[k * s_nodes + j], T[k], sum);
            vstore4(sum, 0, cardinal_s + j * w_terms + m);
        }
    }
}

/* Adds one wavelength's weights to those of a point: weights[channel][m] += xyz[channel] l reflectance[m]. */
static void add_wavelength(const float4 xyz, const float l, __global const float *reflectance, const int w_terms,
                           __global float *weights) {
    const float channel[CHANNELS] = {xyz.x, xyz.y, xyz.z};
    ROLLED for (int c = 0; c < CHANNELS; ++c)
        ROLLED for (int m = 0; m < w_terms; m += W_LANES) {
            __global float *weight = weights + c * w_terms + m;
            vstore4(fma((float4)(channel[c] * l), vload4(0, reflectance + m), vload4(0, weight)), 0, weight);
        }
}

/* The weights of a ring over its group's points. Wavelengths ascend, so the points about them descend. */
static APART void sum_point_weights(const Group group, const Ring ring, const double stretch,
                                    __global const double *kappa, __global const double *lambda_um,
                                    __global const float4 *weights, __global const float *reflectance,
                                    const int w_terms, __global float *point_weights, __global int2 *used) {
    const int about = group.on_nodes ? 1 : ORDER;
    double x[ORDER], factor[ORDER];
    int first = group.points - about, prepared = -1;
    ROLLED for (int o = 0; o < group.points * CHANNELS * w_terms; ++o) point_weights[o] = 0.0f;
    ROLLED for (int l = 0; l < ring.count; ++l) {
        float weight[ORDER] = {1.0f};
        if (group.on_nodes)
            first = group.points - 1 - l;
        else {
            const double at = stretch / lambda_um[ring.nodes + l];
            while (first > 0 && kappa[first + ORDER / 2 - 1] > at) --first;
            if (first != prepared) {
                ROLLED for (int a = 0; a < ORDER; ++a) x[a] = kappa[first + a];
                lagrange_factors(x, factor);
                prepared = first;
            }
            lagrange(x, factor, at, weight);
        }
        if (l == 0) used->y = first + about;
        ROLLED for (int a = 0; a < about; ++a)
            add_wavelength(weights[ring.nodes + l], weight[a], reflectance + (long)(ring.reflectance + l) * w_terms,
                           w_terms, point_weights + (first + a) * CHANNELS * w_terms);
    }
    used->x = first;
}

__kernel void build_operator(__global const Group *groups, __global const Ring *rings,
                             __global const int *first_radius, __global const double *radius,
                             __global const double *rho, __global const double *stretch, __global const double *kappa,
                             __global const double *lambda_um, __global const float4 *weights,
                             __global const float *reflectance, __global const float *to_series,
                             __global const float *w_node, const float s_max, const int ring_count, const int s_nodes,
                             const int w_terms, __global float *lagrange_r, __global float *cardinal_s,
                             __global float *point_weights, __global int2 *used) {
    const Group group = groups[get_global_id(0)];
    const double first_rho = rho[group.ring];
    __global const float *own_w = w_node + (long)get_global_id(0) * w_terms;

    ROLLED for (int p = group.first; p < group.first + group.points; ++p) {
        if (!group.on_radii) radial_weights(radius, first_radius[p], first_rho * kappa[p], lagrange_r + p * ORDER);
        /* s = 2 pi |w| kappa, and 2 s / s_max - 1 is the argument of T_k */
        const float scale = 2.0f * 2.0f * (float)M_PI * (float)kappa[p] / s_max;
        cardinal_functions(scale, own_w, to_series, s_nodes, w_terms, cardinal_s + (long)p * s_nodes * w_terms);
    }
    ROLLED for (int q = 0; q < group.lights * group.rings; ++q) {
        const int i = row_of(group, q, ring_count);
        sum_point_weights(group, rings[i], stretch[i], kappa + group.first, lambda_um, weights, reflectance, w_terms,
                          point_weights + (long)rings[i].point_weights * CHANNELS * w_terms, used + i);
    }
}

/* G of one point at W_BLOCK nodes of w from E at its nodes in s, for both halves. E comes from the spectrum or, between
 * radii, from what was interpolated: OpenCL C asks for a function each. */
#define CONTRACT_S(name, memory)                                                                                       \
    static void name(memory const float *here, memory const float *opposite, __global const float *cardinal_s,         \
                     const int s_nodes, const int w_terms, float16 (*g)[HALVES]) {                                     \
        float16 sum[W_BLOCK][HALVES];                                                                                  \
        UNROLL for (int m = 0; m < W_BLOCK; ++m) sum[m][0] = sum[m][1] = 0.0f;                                         \
        ROLLED for (int j = 0; j < s_nodes; ++j) {                                                                     \
            const float16 a = vload16(j, here), b = vload16(j, opposite);                                              \
            UNROLL for (int m = 0; m < W_BLOCK; ++m) {                                                                 \
                const float16 c = cardinal_s[j * w_terms + m];                                                         \
                sum[m][0] = fma(c, a, sum[m][0]);                                                                      \
                sum[m][1] = fma(c, b, sum[m][1]);                                                                      \
            }                                                                                                          \
        }                                                                                                              \
        UNROLL for (int m = 0; m < W_BLOCK; ++m) {                                                                     \
            g[m][0] = sum[m][0];                                                                                       \
            g[m][1] = sum[m][1];                                                                                       \
        }                                                                                                              \
    }
CONTRACT_S(contract_s_on_radius, __global)
CONTRACT_S(contract_s_between_radii, __private)

/* E of a point between ORDER radii, at every node in s, for both halves. */
static APART void interpolate_r(__global const float *here, __global const float *opposite, const int first_radius,
                                __global const float *lagrange_r, const int s_nodes, float *e_here, float *e_opposite) {
    __global const float *row_here[ORDER], *row_opposite[ORDER];
    ROLLED for (int a = 0; a < ORDER; ++a) {
        /* below the origin, the half turns change places */
        const int i = first_radius + a;
        const long row = (long)abs(i) * s_nodes * LANES;
        row_here[a] = row + (i < 0 ? opposite : here);
        row_opposite[a] = row + (i < 0 ? here : opposite);
    }
    ROLLED for (int j = 0; j < s_nodes; ++j) {
        float16 sum_here = 0.0f, sum_opposite = 0.0f;
        ROLLED for (int a = 0; a < ORDER; ++a) {
            const float16 weight = lagrange_r[a];
            sum_here = fma(weight, vload16(j, row_here[a]), sum_here);
            sum_opposite = fma(weight, vload16(j, row_opposite[a]), sum_opposite);
        }
        vstore16(sum_here, j, e_here);
        vstore16(sum_opposite, j, e_opposite);
    }
}

/* G at the points `from` .. `to` - 1 of a group: g[point][w_terms][half]. */
static APART void evaluate_g(const Group group, const int from, const int to, __global const float *here,
                             __global const float *opposite, __global const int *first_radius,
                             __global const float *lagrange_r, __global const float *cardinal_s, const int s_nodes,
                             const int w_terms, float16 (*g)[HALVES]) {
    ROLLED for (int p = group.first + from; p < group.first + to; ++p, g += w_terms) {
        __global const float *cardinal = cardinal_s + (long)p * s_nodes * w_terms;
        if (group.on_radii) {
            const long row = (long)first_radius[p] * s_nodes * LANES;
            ROLLED for (int m = 0; m < w_terms; m += W_BLOCK)
                contract_s_on_radius(here + row, opposite + row, cardinal + m, s_nodes, w_terms, g + m);
        } else {
            float e_here[LANES * MOST_S_NODES], e_opposite[LANES * MOST_S_NODES];
            interpolate_r(here, opposite, first_radius[p], lagrange_r + p * ORDER, s_nodes, e_here, e_opposite);
            ROLLED for (int m = 0; m < w_terms; m += W_BLOCK)
                contract_s_between_radii(e_here, e_opposite, cardinal + m, s_nodes, w_terms, g + m);
        }
    }
}

/* Accumulate X, Y and Z of one ring over `points` points, at node m of w, for both halves, XYZ_VECTORS at a time:
 *   xyz[c][m][h] += sum_p point_weights[p][c][m] g[p][m][h]     c channel, h half */
static APART void accumulate_xyz(const float16 (*g)[HALVES], const int points, const int m, const int w_terms,
                                 __global const float *point_weights, float16 (*xyz)[HALVES]) {
    ROLLED for (int first = 0; first < HALVES * LANES / WIDTH; first += XYZ_VECTORS) {
        /* a copy stays in registers */
        REGISTER sum[CHANNELS][XYZ_VECTORS];
        UNROLL for (int c = 0; c < CHANNELS; ++c)
            UNROLL for (int h = 0; h < XYZ_VECTORS; ++h)
                sum[c][h] = ((const REGISTER *)xyz[c * w_terms + m])[first + h];
        ROLLED for (int p = 0; p < points; ++p) {
            const REGISTER *here = (const REGISTER *)g[p * w_terms + m] + first;
            __global const float *weights = point_weights + p * CHANNELS * w_terms + m;
            UNROLL for (int h = 0; h < XYZ_VECTORS; ++h)
                UNROLL for (int c = 0; c < CHANNELS; ++c)
                    sum[c][h] = fma((REGISTER)weights[c * w_terms], here[h], sum[c][h]);
        }
        UNROLL for (int c = 0; c < CHANNELS; ++c)
            UNROLL for (int h = 0; h < XYZ_VECTORS; ++h)
                ((REGISTER *)xyz[c * w_terms + m])[first + h] = sum[c][h];
    }
}

/* A ring's Chebyshev terms over its own w, from X, Y, Z at its group's nodes. */
static APART void write_terms(const float16 (*xyz)[HALVES], __global const float *to_w_terms, const int w_terms,
                              const int tile, const int tiles, __global float *ring) {
    ROLLED for (int c = 0; c < CHANNELS; ++c)
        ROLLED for (int k = 0; k < w_terms; k += W_PAIR) {
            float16 sum[W_PAIR][HALVES];
            UNROLL for (int i = 0; i < W_PAIR; ++i) sum[i][0] = sum[i][1] = 0.0f;
            ROLLED for (int m = 0; m < w_terms; ++m)
                UNROLL for (int i = 0; i < W_PAIR; ++i) {
                    const float16 factor = to_w_terms[(k + i) * w_terms + m];
                    sum[i][0] = fma(factor, xyz[c * w_terms + m][0], sum[i][0]);
                    sum[i][1] = fma(factor, xyz[c * w_terms + m][1], sum[i][1]);
                }
            UNROLL for (int i = 0; i < W_PAIR; ++i) {
                const int row = HALVES * tiles * (c * w_terms + k + i);
                vstore16(sum[i][0], row + tile, ring);
                vstore16(sum[i][1], row + tile + tiles, ring);
            }
        }
}

/* A ring's X, Y, Z at one w of each texel, from those at its group's nodes. */
static APART void write_values(const float16 (*xyz)[HALVES], __global const float *to_w_terms, const int w_terms,
                               __global const float *own_x, const int tile, const int tiles, __global float *ring) {
    ROLLED for (int h = 0; h < HALVES; ++h) {
        const float16 x = vload16(tile + h * tiles, own_x);
        float16 sum[CHANNELS] = {0.0f, 0.0f, 0.0f}, before = x, T = 1.0f;
        ROLLED for (int k = 0; k < w_terms; ++k) {
            ROLLED for (int c = 0; c < CHANNELS; ++c) {
                float16 term = 0.0f;
                ROLLED for (int m = 0; m < w_terms; ++m)
                    term = fma((float16)to_w_terms[k * w_terms + m], xyz[c * w_terms + m][h], term);
                sum[c] = fma(T, term, sum[c]);
            }
            /* T_(-1) = T_1 = x */
            const float16 next = 2.0f * x * T - before;
            before = T;
            T = next;
        }
        ROLLED for (int c = 0; c < CHANNELS; ++c) vstore16(sum[c], (c * HALVES + h) * tiles + tile, ring);
    }
}

__kernel void apply_operator(__global const float *spectrum, const int radii, __global const int2 *pairs,
                             __global const Group *groups, __global const Ring *rings, __global const int *first_radius,
                             __global const float *lagrange_r, __global const float *cardinal_s,
                             __global const float *point_weights, __global const int2 *used, const int ring_count,
                             const int s_nodes, const int w_terms, __global const float *to_w_terms,
                             const int is_summed, __global const float *own_x, __global float *table) {
    const Group group = groups[get_global_id(0)];
    const int tile = get_global_id(1), tiles = get_global_size(1), sums = CHANNELS * w_terms;
    const int rows = group.lights * group.rings;
    __global const float *here = spectrum + (long)pairs[tile].x * radii * s_nodes * LANES;
    __global const float *opposite = spectrum + (long)pairs[tile].y * radii * s_nodes * LANES;

    float16 xyz[MOST_RINGS * CHANNELS * MOST_W_TERMS][HALVES], g[CHUNK * MOST_W_TERMS][HALVES];
    ROLLED for (int q = 0; q < rows * sums; ++q) xyz[q][0] = xyz[q][1] = 0.0f;
    ROLLED for (int from = 0; from < group.points; from += CHUNK) {
        const int to = min(from + CHUNK, group.points);
        evaluate_g(group, from, to, here, opposite, first_radius, lagrange_r, cardinal_s, s_nodes, w_terms, g);
        ROLLED for (int q = 0; q < rows; ++q) {
            const int i = row_of(group, q, ring_count);
            const int2 range = used[i];
            const int first = max(from, range.x), points = min(to, range.y) - first;
            __global const float *own = point_weights + (long)(rings[i].point_weights + first) * sums;
            if (points > 0)
                ROLLED for (int m = 0; m < w_terms; ++m)
                    accumulate_xyz(g + (first - from) * w_terms, points, m, w_terms, own, xyz + q * sums);
        }
    }
    ROLLED for (int q = 0; q < rows; ++q) {
        const long i = row_of(group, q, ring_count), azimuths = HALVES * tiles * LANES;
        __global const float *own = to_w_terms + i * w_terms * w_terms;
        if (is_summed)
            write_values(xyz + q * sums, own, w_terms, own_x + i * azimuths, tile, tiles,
                         table + i * CHANNELS * azimuths);
        else
            write_terms(xyz + q * sums, own, w_terms, tile, tiles, table + i * sums * azimuths);
    }
}
