/* DFT stack: F_n[psi, phi] = mean(T_n(h/H) exp(+2 pi i (phi x + psi y))), of the frequencies kept alone.
 *
 *   T_n Chebyshev's polynomials, t = h / H;  x and y count from the middle sample
 *
 * Terms lie side by side in the lanes of one vector, so every sum is a sum of whole vectors and nothing is ever
 * transposed. A transform of N samples goes in two steps, N = N1 N2 (Cooley & Tukey 1965), each a small dense product:
 *
 *   A[k1][n2] = sum_n1 a[n1 N2 + n2] exp(2 pi i n1 k1 / N1)
 *   F[k]      = sum_n2 A[k mod N1][n2] exp(2 pi i n2 k / N)       for the k kept
 *
 * The first pairs n1 with N1 - n1: cosines meet their sum, sines their difference, and k1 serves N1 - k1 too, so
 * N1 / 2 + 1 of either are left. Frequencies of one k1 are taken KEPT at a time, as a block.
 *
 * along_x transforms the rows of samples along x; along_y transforms the columns phi = 0 .. columns - 1 of what it
 * wrote along y, and stores small phi at -phi, too, for heights are real. Work-items take rows or columns
 * get_global_size(0) apart, each with scratch of its own: they outgrow the stacks of a driver's threads. Arguments:
 *
 * along_x
 *   heights     double[ny][nx]                  um    centred
 *   scale       double                          1/um  1 / H
 *   first       int                             1     the first of the terms made here, LANES of them
 *   cosine      REAL[pairs][padded]             1     of 2 pi n1 k1 / N1
 *   sine        REAL[pairs][padded]             1     of 2 pi n1 k1 / N1
 *   turn        REAL[blocks][n2][KEPT][2]       1     cosine and sine of 2 pi n2 k / N
 *   first_of    int[blocks]                     1     the k1 of a block
 *   place       int[blocks][KEPT]               1     the column of each k; -1 for none
 *   axis        Axis                            1     sizes along x
 *   ny          int                             1     rows
 *   scratch     VECTOR[work-items][room]        1     room >= 3 nx
 *   room        long                            1     vectors of scratch of a work-item
 *   narrow      VECTOR[columns][ny][2]          1     result: real and imaginary part, y from the middle sample on
 *
 * along_y
 *   narrow      VECTOR[columns][ny][2]          1     as along_x wrote it
 *   cosine      REAL[pairs][padded]             1     of 2 pi n1 k1 / N1
 *   sine        REAL[pairs][padded]             1     of 2 pi n1 k1 / N1
 *   turn        REAL[blocks][n2][KEPT][2]       1     cosine and sine of 2 pi n2 k / N
 *   first_of    int[blocks]                     1     the k1 of a block
 *   place       int[blocks][KEPT]               1     the row of each k; -1 for none
 *   axis        Axis                            1     sizes along y
 *   columns     int                             1     of narrow
 *   scratch     VECTOR[work-items][room]        1     room >= 2 ny
 *   room        long                            1     vectors of scratch of a work-item
 *   first       int                             1     the first of the terms made here
 *   terms       int                             1     of the stack; those beyond are not stored
 *   reach       int                             1     columns left of phi = 0
 *   phi_max     int                             1     the last column
 *   rows        int                             1     of the stack; psi = 0 is the middle one
 *   mean        REAL                            1     1 / samples
 *   stack       REAL[rows][reach + phi_max + 1][2][terms]   1   result: F_n, real and imaginary parts
 *
 * Set by the host: REAL and LANES, a vector of 64 bytes; STEP, the k1 of real samples that are summed at a time; KEPT;
 * MOST_PAIRS, which bounds pairs.
 */

#include "common.cl"
#define VECTOR NAME(REAL, LANES)

/* n = n1 n2 samples; pairs = n1 / 2 + 1, padded to whole steps; blocks of frequencies */
typedef struct {
    int n, n1, n2, pairs, padded, blocks;
} Axis;

/* T_first and T_(first - 1) of t, doubling the order: T_2n = 2 T_n^2 - 1, T_(2n - 1) = 2 T_n T_(n-1) - t */
static void chebyshev(const double8 t, const int first, double8 *term, double8 *before) {
    double8 here = 1.0, below = t;
    ROLLED for (int bit = first ? 31 - clz(first) : -1; bit >= 0; --bit) {
        /* from T_n, T_(n - 1) to orders 2 n, 2 n - 1, and one further where the bit is set */
        const double8 even = 2.0 * here * here - 1.0, odd = 2.0 * here * below - t;
        const int further = first >> bit & 1;
        here = further ? 2.0 * t * even - odd : even;
        below = further ? even : odd;
    }
    *term = here;
    *before = below;
}

/* Terms first .. first + LANES - 1 of DOUBLES samples t: out[sample][term]. */
static APART void terms_of(const double8 t, const int first, __global REAL *out) {
    double8 before, term;
    chebyshev(t, first, &term, &before);
    ROLLED for (int n = 0; n < LANES; ++n) {
        UNROLL for (int i = 0; i < DOUBLES; ++i) out[i * LANES + n] = ((const double *)&term)[i];
        const double8 next = 2.0 * t * term - before;
        before = term;
        term = next;
    }
}

/* Samples n1 = 0 .. and their mirror images N1 - n1, `stride` apart: sums and differences, `parts` vectors each. */
static INLINE void pair(__global const VECTOR *sample, const long stride, const Axis axis, const int parts, VECTOR *sum,
                        VECTOR *difference) {
    ROLLED for (int n1 = 0; n1 < axis.pairs; ++n1) {
        const int alone = n1 == 0 || 2 * n1 == axis.n1;
        UNROLL for (int part = 0; part < parts; ++part) {
            const VECTOR here = sample[n1 * stride + part];
            const VECTOR mirrored = alone ? (VECTOR)0 : sample[(axis.n1 - n1) * stride + part];
            sum[n1 * parts + part] = here + mirrored;
            difference[n1 * parts + part] = alone ? (VECTOR)0 : here - mirrored;
        }
    }
}

/* The first step's sums over n1 at `step` of its k1: cosines with sums, sines with differences; [k1][part] each. */
static INLINE void sums_over_n1(const VECTOR *sum, const VECTOR *difference, __global const REAL *cosine,
                                __global const REAL *sine, const Axis axis, const int parts, const int step, VECTOR *c,
                                VECTOR *s) {
    VECTOR even[PARTS * STEP], odd[PARTS * STEP];
    UNROLL for (int j = 0; j < parts * step; ++j) even[j] = odd[j] = 0;
    ROLLED for (int n1 = 0; n1 < axis.pairs; ++n1)
        UNROLL for (int j = 0; j < step; ++j) {
            const VECTOR c_j = cosine[n1 * axis.padded + j], s_j = sine[n1 * axis.padded + j];
            UNROLL for (int part = 0; part < parts; ++part) {
                even[parts * j + part] = fma(c_j, sum[n1 * parts + part], even[parts * j + part]);
                odd[parts * j + part] = fma(s_j, difference[n1 * parts + part], odd[parts * j + part]);
            }
        }
    UNROLL for (int j = 0; j < parts * step; ++j) {
        c[j] = even[j];
        s[j] = odd[j];
    }
}

/* A[k1][n2] = c + i s and A[N1 - k1][n2] = c - i s, of real samples (parts = 1) or of complex ones (2). */
static INLINE void store_pair(const VECTOR *c, const VECTOR *s, const int k1, const int n2, const Axis axis,
                              const int parts, __global VECTOR *a) {
    if (k1 >= axis.pairs) return;
    const VECTOR im_c = parts == PARTS ? c[1] : (VECTOR)0, im_s = parts == PARTS ? s[1] : (VECTOR)0;
    __global VECTOR *here = a + PARTS * (k1 * axis.n2 + n2);
    __global VECTOR *mirrored = a + PARTS * ((axis.n1 - k1) * axis.n2 + n2);
    here[0] = c[0] - im_s;
    here[1] = im_c + s[0];
    if (k1 > 0 && 2 * k1 < axis.n1) {
        mirrored[0] = c[0] + im_s;
        mirrored[1] = im_c - s[0];
    }
}

/* The first step: A[k1][n2] of every k1 and n2, real and imaginary part. */
static INLINE void first_step(__global const VECTOR *sample, __global const REAL *cosine, __global const REAL *sine,
                              const Axis axis, const int parts, const int step, __global VECTOR *a) {
    ROLLED for (int n2 = 0; n2 < axis.n2; ++n2) {
        VECTOR sum[PARTS * MOST_PAIRS], difference[PARTS * MOST_PAIRS];
        pair(sample + parts * n2, parts * axis.n2, axis, parts, sum, difference);
        ROLLED for (int k = 0; k < axis.pairs; k += step) {
            VECTOR c[PARTS * STEP], s[PARTS * STEP];
            sums_over_n1(sum, difference, cosine + k, sine + k, axis, parts, step, c, s);
            ROLLED for (int j = 0; j < step; ++j) store_pair(c + parts * j, s + parts * j, k + j, n2, axis, parts, a);
        }
    }
}

static APART void first_step_of_real(__global const VECTOR *sample, __global const REAL *cosine,
                                     __global const REAL *sine, const Axis axis, __global VECTOR *a) {
    first_step(sample, cosine, sine, axis, 1, STEP, a);
}

/* Complex samples take one k1 at a time: their sums are as many vectors as those of two k1 of real ones. */
static APART void first_step_of_complex(__global const VECTOR *sample, __global const REAL *cosine,
                                        __global const REAL *sine, const Axis axis, __global VECTOR *a) {
    first_step(sample, cosine, sine, axis, PARTS, 1, a);
}

/* The second step: F of the KEPT frequencies of a block, from the n2 values A of its k1: f[frequency][part]. */
static APART void second_step(__global const VECTOR *a, __global const REAL *turn, const int n2s, VECTOR (*f)[PARTS]) {
    VECTOR re[KEPT], im[KEPT];
    UNROLL for (int q = 0; q < KEPT; ++q) re[q] = im[q] = 0;
    ROLLED for (int n2 = 0; n2 < n2s; ++n2) {
        const VECTOR a_re = a[PARTS * n2], a_im = a[PARTS * n2 + 1];
        UNROLL for (int q = 0; q < KEPT; ++q) {
            const VECTOR c = turn[2 * (n2 * KEPT + q)], s = turn[2 * (n2 * KEPT + q) + 1];
            re[q] = fma(c, a_re, fma(-s, a_im, re[q]));
            im[q] = fma(s, a_re, fma(c, a_im, im[q]));
        }
    }
    UNROLL for (int q = 0; q < KEPT; ++q) {
        f[q][0] = re[q];
        f[q][1] = im[q];
    }
}

/* Terms of the samples of a row from x = begin to end, at sample[to + x]; DOUBLES at a time, and what spills over the
 * end is written again. */
static INLINE void row_terms(__global const double *row, const double scale, const int first, const int begin,
                             const int end, const int to, __global VECTOR *sample) {
    ROLLED for (int x = begin; x < end; x += DOUBLES) {
        double8 t = 0.0;
        if (x + DOUBLES <= end) t = vload8(0, row + x);
        else ROLLED for (int i = 0; i < end - x; ++i) ((double *)&t)[i] = row[x + i];
        terms_of(scale * t, first, (__global REAL *)(sample + to + x));
    }
}

__kernel void along_x(__global const double *heights, const double scale, const int first, __global const REAL *cosine,
                      __global const REAL *sine, __global const REAL *turn, __global const int *first_of,
                      __global const int *place, const Axis axis, const int ny, __global VECTOR *scratch,
                      const long room, __global VECTOR *narrow) {
    const int nx = axis.n, middle = nx / 2;
    __global VECTOR *sample = scratch + get_global_id(0) * room, *a = sample + nx;

    ROLLED for (int y = get_global_id(0); y < ny; y += get_global_size(0)) {
        __global const double *row = heights + (long)((y + ny / 2) % ny) * nx;
        /* the samples from the middle on, then those before it */
        ROLLED for (int part = 0; part < 2; ++part)
            row_terms(row, scale, first, part ? 0 : middle, part ? middle : nx, part ? nx - middle : -middle, sample);
        first_step_of_real(sample, cosine, sine, axis, a);
        ROLLED for (int b = 0; b < axis.blocks; ++b) {
            VECTOR f[KEPT][PARTS];
            second_step(a + (long)PARTS * first_of[b] * axis.n2, turn + (long)b * axis.n2 * KEPT * 2, axis.n2, f);
            ROLLED for (int q = 0; q < KEPT; ++q) {
                const int column = place[b * KEPT + q];
                if (column < 0) continue;
                narrow[PARTS * ((long)column * ny + y)] = f[q][0];
                narrow[PARTS * ((long)column * ny + y) + 1] = f[q][1];
            }
        }
    }
}

/* The first `lit` lanes of a coefficient's real and imaginary parts, which are `terms` apart. */
static APART void store_terms(const VECTOR re, const VECTOR im, const int lit, const int terms, __global REAL *to) {
    ROLLED for (int n = 0; n < lit; ++n) {
        to[n] = ((const REAL *)&re)[n];
        to[terms + n] = ((const REAL *)&im)[n];
    }
}

__kernel void along_y(__global const VECTOR *narrow, __global const REAL *cosine, __global const REAL *sine,
                      __global const REAL *turn, __global const int *first_of, __global const int *place,
                      const Axis axis, const int columns, __global VECTOR *scratch, const long room, const int first,
                      const int terms, const int reach, const int phi_max, const int rows, const REAL mean,
                      __global REAL *stack) {
    __global VECTOR *a = scratch + get_global_id(0) * room;
    const int lit = min(LANES, terms - first);
    const long width = reach + phi_max + 1;

    ROLLED for (int phi = get_global_id(0); phi < columns; phi += get_global_size(0)) {
        first_step_of_complex(narrow + (long)PARTS * phi * axis.n, cosine, sine, axis, a);
        ROLLED for (int b = 0; b < axis.blocks; ++b) {
            VECTOR f[KEPT][PARTS];
            second_step(a + (long)PARTS * first_of[b] * axis.n2, turn + (long)b * axis.n2 * KEPT * 2, axis.n2, f);
            ROLLED for (int q = 0; q < KEPT; ++q) {
                const int row = place[b * KEPT + q];
                if (row < 0) continue;
                __global REAL *here = stack + (row * width + reach + phi) * PARTS * terms + first;
                __global REAL *mirror = stack + ((rows - 1 - row) * width + reach - phi) * PARTS * terms + first;
                if (phi <= phi_max) store_terms(mean * f[q][0], mean * f[q][1], lit, terms, here);
                if (phi > 0 && phi <= reach) store_terms(mean * f[q][0], -mean * f[q][1], lit, terms, mirror);
            }
        }
    }
}
