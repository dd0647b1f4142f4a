/* Spectral integration as a linear operator from E(r, s) to a ring of the polar table, the same for every azimuth.
 *
 *   I(rho, phi, w) = sum_l weights[l] E(rho / l, phi, 2 pi |w| / l)      in X, Y and Z (docs/conventions.md, less C cos ti)
 *   E(r, s)        = sum_(a, j) L_a(r) C_j(s) E(r_a, s_j)                L Lagrange's polynomials on ORDER nodes about r,
 *                                                                         C cardinal functions of Chebyshev nodes
 *   I(rho, phi, w) = sum_k T_k(2 |w| / w_max - 1) table[k],  w_max = sqrt(4 - rho^2)
 *
 * At a ring and a w, E is wanted along one line through the origin, r = rho kappa and s = 2 pi |w| kappa with
 * kappa = 1 / l. It is taken there at points kappa_p, once for all wavelengths, which are interpolated from it:
 *
 *   G(p, w) = sum_j C_j(2 pi |w| kappa_p) E(rho kappa_p, s_j)
 *   I(w)    = sum_p shares[p] G(p, w),   shares[p] = sum_l weights[l] L_p(1 / l)
 *
 * Where points are chosen on radii of E (rho kappa_p = r_a) nothing is interpolated over r; where they are a ring's
 * wavelengths, nothing along the line. A ring t rho has the same lines at t w, where its wavelengths lie at t / l: rings
 * that follow each other share G, as a group, at nodes w_m of its first ring; what I is at nodes of a ring's own follows
 * from the polynomial through these.
 *
 * Given at launch: s_nodes, and w_terms, a multiple of 4. Set by the host: ORDER (even); MOST_RINGS of a group;
 * MOST_S_NODES and MOST_W_TERMS, which bound what a work-item keeps; W_BLOCK (1, 2 or 4), nodes of w whose sums stay in
 * registers.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")
#define ROLLED _Pragma("nounroll")  /* copies of a loop's body would cost compiling time and win nothing */
/* a function that is compiled by itself, called where its loops begin: the compiler's time grows faster than a body's length */
#define APART __attribute__((noinline))
#define CHUNK 24  /* points whose G waits in the nearest cache */

typedef struct {
    int first, points;   /* among those of all groups */
    int on_radii;        /* whether they lie on radii of E */
    int on_nodes;        /* whether they are the wavelengths themselves, from the last to the first, of its one ring */
    int ring, rings;     /* the first, and how many */
} Group;

typedef struct {
    int shares;          /* where its rows of `shares` begin, one for every point of its group */
    int nodes, count;    /* where its quadrature begins, and its length */
    int reflected;       /* where its rows of `reflectance` begin */
} Ring;

/* r of node i; E(-r, phi) = E(r, phi + pi), so nodes go on below 0 */
static double node(__global const double *radius, const int i) { return i < 0 ? -radius[-i] : radius[i]; }

/* Lagrange's polynomials on the ORDER nodes at `x`, at `at` */
static APART void lagrange(const double *x, const double at, float *weight) {
    ROLLED for (int a = 0; a < ORDER; ++a) {
        double above = 1.0, below = 1.0;
        ROLLED for (int b = 0; b < ORDER; ++b) {
            above *= a == b ? 1.0 : at - x[b];
            below *= a == b ? 1.0 : x[a] - x[b];
        }
        weight[a] = above / below;
    }
}

/* What one ring takes of each of its group's points. Wavelengths ascend, so the points about them descend. */
static APART void share_points(const Group group, const Ring ring, const double stretch, __global const double *line,
                         __global const double *lambda, __global const float4 *weights,
                         __global const float *reflectance, const int w_terms, __global float *shares,
                         __global int2 *span) {
    const int about = group.on_nodes ? 1 : ORDER;
    int first = group.points - about;
    ROLLED for (int o = 0; o < group.points * 3 * w_terms; ++o) shares[o] = 0.0f;
    ROLLED for (int l = 0; l < ring.count; ++l) {
        float weight[ORDER] = {1.0f};
        if (group.on_nodes)
            first = group.points - 1 - l;
        else {
            const double at = stretch / lambda[ring.nodes + l];
            while (first > 0 && line[first + ORDER / 2 - 1] > at) --first;
            double x[ORDER];
            ROLLED for (int a = 0; a < ORDER; ++a) x[a] = line[first + a];
            lagrange(x, at, weight);
        }
        if (l == 0) span->y = first + about;
        const float4 xyz = weights[ring.nodes + l];
        const float channel[3] = {xyz.x, xyz.y, xyz.z};
        __global const float *reflected = reflectance + (long)(ring.reflected + l) * w_terms;
        ROLLED for (int a = 0; a < about; ++a)
            ROLLED for (int c = 0; c < 3; ++c)
                ROLLED for (int m = 0; m < w_terms; m += 4) {
                    __global float *share = shares + ((first + a) * 3 + c) * w_terms + m;
                    vstore4(fma((float4)(channel[c] * weight[a]), vload4(0, reflected + m), vload4(0, share)), 0, share);
                }
    }
    span->x = first;
}

/* The operator of each group of rings. One work-item, one group.
 *
 *   place     int[points]            the radius of a point, or the first of the ORDER about it: may be negative
 *   radius    double[radii]          r_a, 1/um, ascending from 0
 *   rho       double[rings]
 *   stretch   double[rings]          t, of the ring over its group's first
 *   kappa     double[points]         ascending in each group, 1/um
 *   lambda    double[], weights float4[]    um; X, Y, Z: the nodes of every ring's quadrature
 *   reflectance  float[...][w_terms] of the material at each wavelength of a ring and each of its group's nodes of w;
 *                                    1 outside metals
 *   cardinal  float[s_nodes][s_nodes]    C_j = sum_k cardinal[k][j] T_k
 *   w_node    float[w_terms]         nodes of w in [0, 1], shares of the first ring's w_max
 *   along_r   float[points][ORDER]   L_a of a point between radii
 *   along_s   float[points][s_nodes][w_terms]   C_j at every node of w
 *   shares    float[points of its group, for every ring][3][w_terms]
 *   span      int2[rings]            the points of its group that a ring takes from, and the end of them
 */
__kernel void build_operator(__global const Group *groups, __global const Ring *rings, __global const int *place,
                             __global const double *radius, __global const double *rho, __global const double *stretch,
                             __global const double *kappa, __global const double *lambda,
                             __global const float4 *weights, __global const float *reflectance,
                             __global const float *cardinal, __global const float *w_node, const float s_max,
                             const int s_nodes, const int w_terms, __global float *along_r, __global float *along_s, __global float *shares,
                             __global int2 *span) {
    const Group group = groups[get_global_id(0)];
    const double from = rho[group.ring];
    const float w_max = sqrt(fmax(4.0 - from * from, 0.0));

    ROLLED for (int p = group.first; p < group.first + group.points; ++p) {
        if (!group.on_radii) {
            double x[ORDER];
            ROLLED for (int a = 0; a < ORDER; ++a) x[a] = node(radius, place[p] + a);
            float weight[ORDER];
            lagrange(x, from * kappa[p], weight);
            ROLLED for (int a = 0; a < ORDER; ++a) along_r[p * ORDER + a] = weight[a];
        }
        const float scale = 2.0f * 2.0f * (float)M_PI * w_max * (float)kappa[p] / s_max;
        ROLLED for (int m = 0; m < w_terms; m += 4) {
            const float4 z = scale * vload4(0, w_node + m) - 1.0f;
            float4 T[MOST_S_NODES];
            T[0] = 1.0f;
            T[1] = z;
            ROLLED for (int k = 2; k < s_nodes; ++k) T[k] = 2.0f * z * T[k - 1] - T[k - 2];
            ROLLED for (int j = 0; j < s_nodes; ++j) {
                float4 sum = 0.0f;
                ROLLED for (int k = 0; k < s_nodes; ++k) sum = fma((float4)cardinal[k * s_nodes + j], T[k], sum);
                vstore4(sum, 0, along_s + ((long)p * s_nodes + j) * w_terms + m);
            }
        }
    }
    ROLLED for (int i = group.ring; i < group.ring + group.rings; ++i)
        share_points(group, rings[i], stretch[i], kappa + group.first, lambda, weights, reflectance,
                     w_terms, shares + (long)rings[i].shares * 3 * w_terms, span + i);
}

/* G of one point at W_BLOCK nodes of w from E at its nodes in s, for both tiles. E comes from the spectrum or, between
 * radii, from what was interpolated: OpenCL C asks for a function each. */
#define ALONG_LINE(name, memory)                                                                                       \
    static void name(memory const float *here, memory const float *opposite, __global const float *along_s,            \
                     const int s_nodes, const int w_terms, float16 (*line)[2]) {                                       \
        float16 sum[W_BLOCK][2];                                                                                       \
        UNROLL for (int m = 0; m < W_BLOCK; ++m) sum[m][0] = sum[m][1] = 0.0f;                                         \
        ROLLED for (int j = 0; j < s_nodes; ++j) {                                                                     \
            const float16 a = vload16(j, here), b = vload16(j, opposite);                                              \
            UNROLL for (int m = 0; m < W_BLOCK; ++m) {                                                                 \
                const float16 c = along_s[j * w_terms + m];                                                            \
                sum[m][0] = fma(c, a, sum[m][0]);                                                                      \
                sum[m][1] = fma(c, b, sum[m][1]);                                                                      \
            }                                                                                                          \
        }                                                                                                              \
        UNROLL for (int m = 0; m < W_BLOCK; ++m) {                                                                     \
            line[m][0] = sum[m][0];                                                                                    \
            line[m][1] = sum[m][1];                                                                                    \
        }                                                                                                              \
    }
ALONG_LINE(block_on_radius, __global)
ALONG_LINE(block_between_radii, __private)

/* E of a point between ORDER radii, at every node in s, for both tiles */
static APART void between_radii(__global const float *here, __global const float *opposite, const int first,
                          __global const float *along_r, const int s_nodes, float *e_here, float *e_opposite) {
    __global const float *row_here[ORDER], *row_opposite[ORDER];
    ROLLED for (int k = 0; k < ORDER; ++k) {
        /* below the origin, the half turns change places */
        const int i = first + k;
        const long row = 16L * abs(i) * s_nodes;
        row_here[k] = row + (i < 0 ? opposite : here);
        row_opposite[k] = row + (i < 0 ? here : opposite);
    }
    ROLLED for (int j = 0; j < s_nodes; ++j) {
        float16 a = 0.0f, b = 0.0f;
        ROLLED for (int k = 0; k < ORDER; ++k) {
            const float16 weight = along_r[k];
            a = fma(weight, vload16(j, row_here[k]), a);
            b = fma(weight, vload16(j, row_opposite[k]), b);
        }
        vstore16(a, j, e_here);
        vstore16(b, j, e_opposite);
    }
}

/* What CHUNK points or fewer add to a ring's X, Y, Z at node m of w, for both tiles.
 *
 *   line    [points][w_terms][2]       G
 *   sum     [3][w_terms][2]            the ring's
 */
static APART void add_shares(const float16 (*line)[2], const int points, const int m, const int w_terms,
                       __global const float *shares, float16 (*sum)[2]) {
    float16 part[3][2];
    UNROLL for (int c = 0; c < 3; ++c)
        UNROLL for (int tile = 0; tile < 2; ++tile) part[c][tile] = sum[c * w_terms + m][tile];
    ROLLED for (int p = 0; p < points; ++p) {
        const float16 a = line[p * w_terms + m][0], b = line[p * w_terms + m][1];
        UNROLL for (int c = 0; c < 3; ++c) {
            const float16 share = shares[(p * 3 + c) * w_terms + m];
            part[c][0] = fma(share, a, part[c][0]);
            part[c][1] = fma(share, b, part[c][1]);
        }
    }
    UNROLL for (int c = 0; c < 3; ++c)
        UNROLL for (int tile = 0; tile < 2; ++tile) sum[c * w_terms + m][tile] = part[c][tile];
}

/* G of some points of a group at every node of w, for both tiles: [points][w_terms][2] */
static APART void take_line(const Group group, const int from, const int to, __global const float *here,
                      __global const float *opposite, __global const int *place, __global const float *along_r,
                      __global const float *along_s, const int s_nodes, const int w_terms, float16 (*line)[2]) {
    ROLLED for (int p = group.first + from; p < group.first + to; ++p, line += w_terms) {
        __global const float *weights = along_s + (long)p * s_nodes * w_terms;
        if (group.on_radii) {
            const long row = (long)place[p] * s_nodes * 16;
            ROLLED for (int m = 0; m < w_terms; m += W_BLOCK)
                block_on_radius(here + row, opposite + row, weights + m, s_nodes, w_terms, line + m);
        } else {
            float e_here[16 * MOST_S_NODES], e_opposite[16 * MOST_S_NODES];
            between_radii(here, opposite, place[p], along_r + p * ORDER, s_nodes, e_here, e_opposite);
            ROLLED for (int m = 0; m < w_terms; m += W_BLOCK)
                block_between_radii(e_here, e_opposite, weights + m, s_nodes, w_terms, line + m);
        }
    }
}

/* A ring's Chebyshev terms over its own w, from values at its group's nodes */
static APART void write_terms(const float16 (*sum)[2], __global const float *w_series, const int w_terms, const int tile,
                        const int tiles, __global float *ring) {
    ROLLED for (int c = 0; c < 3; ++c)
        ROLLED for (int k = 0; k < w_terms; ++k) {
            float16 a = 0.0f, b = 0.0f;
            ROLLED for (int m = 0; m < w_terms; ++m) {
                a = fma((float16)w_series[k * w_terms + m], sum[c * w_terms + m][0], a);
                b = fma((float16)w_series[k * w_terms + m], sum[c * w_terms + m][1], b);
            }
            vstore16(a, 2 * tiles * (c * w_terms + k) + tile, ring);
            vstore16(b, 2 * tiles * (c * w_terms + k) + tile + tiles, ring);
        }
}

/* The table of one group of rings, at the sixteen azimuths of a tile and those half a turn on. One work-item, one group
 * and one tile of half a turn.
 *
 *   spectrum  float[2 * tiles][radii][s_nodes][16]   E, as polar_power_spectrum.cl writes it
 *   w_series  float[rings][w_terms][w_terms]         Chebyshev coefficients over a ring's w from values at its group's
 *                                                    nodes, [term][w node]
 *   table     float[rings][3][w_terms][16 * 2 * tiles]
 */
__kernel void apply_operator(__global const float *spectrum, const int radii, __global const Group *groups,
                             __global const Ring *rings, __global const int *place, __global const float *along_r,
                             __global const float *along_s, __global const float *shares, __global const int2 *span,
                             const int s_nodes, const int w_terms, __global const float *w_series,
                             __global float *table) {
    const Group group = groups[get_global_id(0)];
    const int tile = get_global_id(1), tiles = get_global_size(1);
    __global const float *here = spectrum + (long)tile * radii * s_nodes * 16;
    __global const float *opposite = here + (long)tiles * radii * s_nodes * 16;

    float16 sum[MOST_RINGS * 3 * MOST_W_TERMS][2], line[CHUNK * MOST_W_TERMS][2];
    ROLLED for (int q = 0; q < group.rings * 3 * w_terms; ++q) sum[q][0] = sum[q][1] = 0.0f;
    ROLLED for (int from = 0; from < group.points; from += CHUNK) {
        const int to = min(from + CHUNK, group.points);
        take_line(group, from, to, here, opposite, place, along_r, along_s, s_nodes, w_terms, line);
        ROLLED for (int i = 0; i < group.rings; ++i) {
            const int2 taken = span[group.ring + i];
            const int first = max(from, taken.x), points = min(to, taken.y) - first;
            __global const float *own = shares + (long)(rings[group.ring + i].shares + first) * 3 * w_terms;
            if (points > 0)
                ROLLED for (int m = 0; m < w_terms; ++m)
                    add_shares(line + (first - from) * w_terms, points, m, w_terms, own, sum + i * 3 * w_terms);
        }
    }
    ROLLED for (int i = 0; i < group.rings; ++i) {
        const long ring = group.ring + i;
        write_terms(sum + i * 3 * w_terms, w_series + ring * w_terms * w_terms, w_terms, tile, tiles,
                    table + ring * 96 * w_terms * tiles);
    }
}
