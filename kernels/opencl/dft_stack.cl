/* DFT stack: F_n[psi, phi] = mean(term_n(h/H) exp(+2 pi i (phi x + psi y))), of the frequencies kept alone.
 *
 *   term_n = T_n (Chebyshev's) or t^n, t = h / H;  x and y count from the middle sample
 *
 * Terms lie side by side in the lanes of one vector, so every sum is a sum of whole vectors and nothing is ever
 * transposed. A transform of N samples goes in two steps, N = N1 N2 (Cooley & Tukey 1965), each a small dense product:
 *
 *   A[k1][n2] = sum_n1 a[n1 N2 + n2] exp(2 pi i n1 k1 / N1)
 *   F[k]      = sum_n2 A[k mod N1][n2] exp(2 pi i n2 k / N)       for the k kept
 *
 * The first pairs n1 with N1 - n1: cosines meet their sum, sines their difference, and k1 serves N1 - k1 too, so
 * N1 / 2 + 1 of either are left. Tables of an axis:
 *
 *   cosine, sine   REAL[pairs][padded]           of 2 pi n1 k1 / N1; k1 padded to whole blocks of STEP
 *   turn           REAL[blocks][N2][KEPT][2]     cosine and sine of 2 pi n2 k / N, KEPT frequencies of one k1 a block
 *   first_of       int[blocks]                   a block's k1
 *   place          int[blocks][KEPT]             where F[k] goes: its column or row; -1 for nothing
 *
 * Set by the host: REAL and its vectors of LANES; CHEBYSHEV 0 or 1; STEP_X, STEP_Y; KEPT; MOST_PAIRS, which bounds
 * pairs. Work-items take rows or columns get_global_size(0) apart, each with `room` vectors of scratch of its own: they
 * outgrow the stacks of a driver's threads.
 */

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define UNROLL _Pragma("unroll")
#define JOIN(a, b) a##b
#define NAME(a, b) JOIN(a, b)
#define VECTOR NAME(REAL, LANES)

/* n = n1 n2 samples; pairs = n1 / 2 + 1, padded to whole blocks; blocks of frequencies */
typedef struct {
    int n, n1, n2, pairs, padded, blocks;
} Axis;

/* terms first .. first + LANES - 1 of eight samples t, a vector each */
static void terms_of(const double8 t, const int first, __global REAL *out) {
    double8 before, term;
    if (CHEBYSHEV) {
        const double8 angle = acos(clamp(t, (double8)-1.0, (double8)1.0));
        term = first == 0 ? (double8)1.0 : cos(first * angle);
        before = first == 0 ? t : cos((first - 1) * angle);
    } else {
        term = 1.0;
        for (int n = 0; n < first; ++n) term *= t;
        before = 0.0;
    }
    for (int n = 0; n < LANES; ++n) {
        UNROLL for (int i = 0; i < 8; ++i) out[i * LANES + n] = ((const double *)&term)[i];
        const double8 next = CHEBYSHEV ? 2.0 * t * term - before : t * term;
        before = term;
        term = next;
    }
}

/* Samples n1 = 0 .. and their mirror images N1 - n1, `stride` apart: their sums and differences. */
static void pair(__global const VECTOR *sample, const long stride, const Axis axis, VECTOR *sum, VECTOR *difference) {
    for (int n1 = 0; n1 < axis.pairs; ++n1) {
        const int alone = n1 == 0 || 2 * n1 == axis.n1;
        const VECTOR a = sample[n1 * stride], b = alone ? (VECTOR)0 : sample[(axis.n1 - n1) * stride];
        sum[n1] = a + b;
        difference[n1] = alone ? (VECTOR)0 : a - b;
    }
}

/* F of the KEPT frequencies of a block, from the n2 values A of its k1: (re, im) pairs. */
static void frequencies(__global const VECTOR *a, __global const REAL *turn, const int n2s, VECTOR *re, VECTOR *im) {
    UNROLL for (int q = 0; q < KEPT; ++q) re[q] = im[q] = 0;
    for (int n2 = 0; n2 < n2s; ++n2) {
        UNROLL for (int q = 0; q < KEPT; ++q) {
            const VECTOR c = turn[2 * (n2 * KEPT + q)], s = turn[2 * (n2 * KEPT + q) + 1];
            re[q] = fma(c, a[2 * n2], fma(-s, a[2 * n2 + 1], re[q]));
            im[q] = fma(s, a[2 * n2], fma(c, a[2 * n2 + 1], im[q]));
        }
    }
}

/* Rows of samples, transformed along x.
 *
 *   heights  double[ny][nx]                    centred; times scale they are t
 *   narrow   VECTOR[columns][ny][2]            real and imaginary part, y counted from the middle sample
 */
__kernel void along_x(__global const double *heights, const double scale, const int first, __global const REAL *cosine,
                      __global const REAL *sine, __global const REAL *turn, __global const int *first_of,
                      __global const int *place, const Axis axis, const int ny, __global VECTOR *scratch, const long room,
                      __global VECTOR *narrow) {
    const int nx = axis.n;
    __global VECTOR *sample = scratch + get_global_id(0) * room, *a = sample + nx;

    for (int y = get_global_id(0); y < ny; y += get_global_size(0)) {
        __global const double *row = heights + (long)((y + ny / 2) % ny) * nx;
        /* the samples from the middle on, then those before it; what spills over their ends is written again */
        for (int part = 0; part < 2; ++part) {
            const int begin = part ? 0 : nx / 2, end = part ? nx / 2 : nx, to = part ? nx - nx / 2 : -(nx / 2);
            for (int x = begin; x < end; x += 8) {
                double8 t = 0.0;
                if (x + 8 <= end) t = vload8(0, row + x);
                else for (int i = 0; i < end - x; ++i) ((double *)&t)[i] = row[x + i];
                terms_of(scale * t, first, (__global REAL *)(sample + to + x));
            }
        }
        for (int n2 = 0; n2 < axis.n2; ++n2) {
            VECTOR sum[MOST_PAIRS], difference[MOST_PAIRS];
            pair(sample + n2, axis.n2, axis, sum, difference);
            for (int k = 0; k < axis.pairs; k += STEP_X) {
                VECTOR c[STEP_X], s[STEP_X];
                UNROLL for (int j = 0; j < STEP_X; ++j) c[j] = s[j] = 0;
                for (int n1 = 0; n1 < axis.pairs; ++n1)
                    UNROLL for (int j = 0; j < STEP_X; ++j) {
                        c[j] = fma((VECTOR)cosine[n1 * axis.padded + k + j], sum[n1], c[j]);
                        s[j] = fma((VECTOR)sine[n1 * axis.padded + k + j], difference[n1], s[j]);
                    }
                UNROLL for (int j = 0; j < STEP_X; ++j) {
                    const int k1 = k + j;
                    if (k1 < axis.pairs) {
                        a[2 * (k1 * axis.n2 + n2)] = c[j];
                        a[2 * (k1 * axis.n2 + n2) + 1] = s[j];
                        if (k1 > 0 && 2 * k1 < axis.n1) {
                            a[2 * ((axis.n1 - k1) * axis.n2 + n2)] = c[j];
                            a[2 * ((axis.n1 - k1) * axis.n2 + n2) + 1] = -s[j];
                        }
                    }
                }
            }
        }
        for (int b = 0; b < axis.blocks; ++b) {
            VECTOR re[KEPT], im[KEPT];
            frequencies(a + 2L * first_of[b] * axis.n2, turn + (long)b * axis.n2 * KEPT * 2, axis.n2, re, im);
            UNROLL for (int q = 0; q < KEPT; ++q) {
                const int column = place[b * KEPT + q];
                if (column >= 0) {
                    narrow[2 * ((long)column * ny + y)] = re[q];
                    narrow[2 * ((long)column * ny + y) + 1] = im[q];
                }
            }
        }
    }
}

/* Columns of `narrow`, phi = 0 .. columns - 1, transformed along y; small phi also serve -phi, for heights are real.
 *
 *   stack    REAL[rows][reach + phi_max + 1][2][terms]     phi from -reach on, psi from -(rows - 1) / 2 on
 */
__kernel void along_y(__global const VECTOR *narrow, __global const REAL *cosine, __global const REAL *sine,
                      __global const REAL *turn, __global const int *first_of, __global const int *place,
                      const Axis axis, const int columns, __global VECTOR *scratch, const long room, const int first,
                      const int terms, const int reach, const int phi_max, const int rows, const REAL mean,
                      __global REAL *stack) {
    __global VECTOR *a = scratch + get_global_id(0) * room;
    const int lit = min(LANES, terms - first);

    for (int phi = get_global_id(0); phi < columns; phi += get_global_size(0)) {
        __global const VECTOR *column = narrow + 2L * phi * axis.n;
        for (int n2 = 0; n2 < axis.n2; ++n2) {
            VECTOR sum_re[MOST_PAIRS], sum_im[MOST_PAIRS], difference_re[MOST_PAIRS], difference_im[MOST_PAIRS];
            pair(column + 2 * n2, 2 * axis.n2, axis, sum_re, difference_re);
            pair(column + 2 * n2 + 1, 2 * axis.n2, axis, sum_im, difference_im);
            for (int k = 0; k < axis.pairs; k += STEP_Y) {
                VECTOR re_c[STEP_Y], im_c[STEP_Y], re_s[STEP_Y], im_s[STEP_Y];
                UNROLL for (int j = 0; j < STEP_Y; ++j) re_c[j] = im_c[j] = re_s[j] = im_s[j] = 0;
                for (int n1 = 0; n1 < axis.pairs; ++n1)
                    UNROLL for (int j = 0; j < STEP_Y; ++j) {
                        const VECTOR c = cosine[n1 * axis.padded + k + j], s = sine[n1 * axis.padded + k + j];
                        re_c[j] = fma(c, sum_re[n1], re_c[j]);
                        im_c[j] = fma(c, sum_im[n1], im_c[j]);
                        re_s[j] = fma(s, difference_re[n1], re_s[j]);
                        im_s[j] = fma(s, difference_im[n1], im_s[j]);
                    }
                UNROLL for (int j = 0; j < STEP_Y; ++j) {
                    const int k1 = k + j;
                    if (k1 < axis.pairs) {
                        a[2 * (k1 * axis.n2 + n2)] = re_c[j] - im_s[j];
                        a[2 * (k1 * axis.n2 + n2) + 1] = im_c[j] + re_s[j];
                        if (k1 > 0 && 2 * k1 < axis.n1) {
                            a[2 * ((axis.n1 - k1) * axis.n2 + n2)] = re_c[j] + im_s[j];
                            a[2 * ((axis.n1 - k1) * axis.n2 + n2) + 1] = im_c[j] - re_s[j];
                        }
                    }
                }
            }
        }
        for (int b = 0; b < axis.blocks; ++b) {
            VECTOR re[KEPT], im[KEPT];
            frequencies(a + 2L * first_of[b] * axis.n2, turn + (long)b * axis.n2 * KEPT * 2, axis.n2, re, im);
            UNROLL for (int q = 0; q < KEPT; ++q) {
                const int row = place[b * KEPT + q];
                if (row < 0) continue;
                const long width = reach + phi_max + 1;
                __global REAL *here = stack + ((row * width + reach + phi) * 2) * terms + first;
                __global REAL *mirror = stack + (((rows - 1 - row) * width + reach - phi) * 2) * terms + first;
                for (int n = 0; n < lit; ++n) {
                    const REAL real = mean * ((const REAL *)&re[q])[n], imaginary = mean * ((const REAL *)&im[q])[n];
                    if (phi <= phi_max) {
                        here[n] = real;
                        here[terms + n] = imaginary;
                    }
                    if (phi > 0 && phi <= reach) {
                        mirror[n] = real;
                        mirror[terms + n] = -imaginary;
                    }
                }
            }
        }
    }
}
