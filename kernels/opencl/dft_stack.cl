/* DFT stack: F_n[psi, phi] = mean(T_n(h/H) exp(+2 pi i (phi x + psi y))), of the frequencies kept alone.
 *
 *   T_n Chebyshev's polynomials, t = h / H;  x and y count from the middle sample
 *
 * Terms are adjacent in the lanes of a vector, so every sum is a sum of whole vectors, and only terms are transposed,
 * as they are made. A transform of N = N1 N2 N3 samples takes three levels (Cooley & Tukey 1965):
 *
 *   A[k1][n2, n3] = sum_n1 a[(n1 N2 + n2) N3 + n3] exp(2 pi i n1 k1 / N1)
 *   B[k][n3]      = sum_n2 A[k1][n2, n3] exp(2 pi i n2 k1 / (N1 N2)) exp(2 pi i n2 k2 / N2),     k = k1 + N1 k2
 *   F[k + N1 N2 k3] = sum_n3 B[k][n3] exp(2 pi i n3 k / N) exp(2 pi i n3 k3 / N3)                for those kept
 *
 * The first two are done for one n3 after the other, on a few vectors in the nearest cache. Each level is a dense
 * transform of few points. It is folded before it is summed: points j and N1 - j have the same cosine and opposite
 * sines, hence a sum and a difference of them meet half of the factors, and the frequencies k and N1 - k share both
 * results. Where N1 is even, points j and j + N1 / 2 are added first for even k, and subtracted for odd k.
 *
 * What lies between both axes may be larger than memory allows. Then strips of rows, y = s, s + S, ... each, follow one
 * another, and their transforms along y are added up: F[psi] = sum_s exp(2 pi i s psi / N) F_s[psi mod N / S].
 *
 * along_x transforms the rows of samples along x; along_y transforms the columns phi = 0 .. columns - 1 of what it
 * wrote along y, and stores small phi at -phi, too, for heights are real. Real samples need k1 <= N1 / 2 alone, and the
 * frequencies -k follow. Work-items take rows or columns get_global_size(0) apart, each with scratch of its own.
 * Arguments:
 *
 * along_x
 *   heights     double[ny][nx]                  um    centred
 *   scale       double                          1/um  1 / H
 *   first       int                             1     the first of the terms made here, TERMS of them
 *   factors     REAL[]                          1     cosines and sines of the levels, one after the other:
 *                                                     [sets][blocks][entries - 1][K_PAIRS][2]
 *   turn        REAL[n1 + n1 n2 + n][2]         1     cosine and sine of 0, [n1]; of 2 pi n2 k1 / (N1 N2), [k1][n2];
 *                                                     and of 2 pi n3 k / N, [k][n3]
 *   of          int[tiles]                      1     the k of a tile of the last level
 *   place       int[tiles][sets][blocks][K_PAIRS][2]    1     the column of each frequency, those of -k3 second; -1 for
 *                                                     none, and -2 - column for that of its negative
 *   axis        Axis                            1     sizes along x
 *   rows        int2                            1     of a strip, and strips: strip s has the rows y = s, s + strips, ...
 *   strip       int                             1     s
 *   along       int2                            1     N1 N2 and N3 along y: the order of rows in `narrow`
 *   tall        int                             1     rows of `narrow` from column to column
 *   scratch     VECTOR[work-items][room]        1     room as `transform` computes it
 *   room        long                            1     vectors of scratch of a work-item
 *   narrow      VECTOR[columns][tall][GROUPS][2]  1   result: real and imaginary part; row j of the strip, whose y
 *                                                     counts from the middle sample, is at (j mod N3) N1 N2 + j / N3
 *
 * along_y
 *   narrow      VECTOR[columns][tall][GROUPS][2]  1   as along_x wrote it
 *   factors     REAL[]                          1     as above, along y
 *   turn        REAL[n1 + n1 n2 + n][2]         1     as above, along y
 *   of          int[tiles]                      1     the k of a tile of the last level
 *   place       int[tiles][sets][blocks][K_PAIRS][2]    1     the first row of each frequency, which repeats after as
 *                                                     many rows as the strip has samples; -1 for none
 *   axis        Axis                            1     sizes along y, of a strip
 *   columns     int                             1     of narrow
 *   tall        int                             1     rows of `narrow` from column to column
 *   scratch     VECTOR[work-items][room]        1     as above
 *   room        long                            1     vectors of scratch of a work-item
 *   first       int                             1     the first of the terms made here
 *   terms       int                             1     of the stack; those beyond are not stored
 *   reach       int                             1     columns left of phi = 0
 *   phi_max     int                             1     the last column
 *   rows        int                             1     of the stack; psi = 0 is the middle one
 *   shift       REAL[rows][2]                   1     exp(2 pi i s psi / N) / samples, of strip s
 *   strip       int                             1     s: what is there already is added to, but for the first strip
 *   stack       REAL[rows][reach + phi_max + 1][2][terms]   1   result: F_n, real and imaginary parts
 *
 * Set by the host: REAL and WIDTH, one vector register of the device; K_PAIRS, the pairs of frequencies k and -k whose
 * sums stay in registers, four vectors each.
 */

#include "common.cl"
#define VECTOR NAME(REAL, WIDTH)
#define REAL8 NAME(REAL, 8)
#define TERMS (64 / (int)sizeof(REAL)) /* made at a time: a line of the cache */
#define GROUPS (TERMS / WIDTH)         /* vectors of them */

/* What one kernel writes and the other reads is larger than caches: lines written past them need not be read first, and
 * lines that are wanted next are asked for in time. */
#if defined(__has_builtin)
#if __has_builtin(__builtin_nontemporal_store) && __has_builtin(__builtin_prefetch)
#define STREAM(value, to) __builtin_nontemporal_store(value, to)
#define PREFETCH(at) __builtin_prefetch((const void *)(uintptr_t)(at))
#endif
#endif
#ifndef STREAM
#define STREAM(value, to) (*(to) = (value))
#define PREFETCH(at)
#endif

/* A transform of few points, folded to `sets` (1, or 2 of even and of odd frequencies) of `entries`, whose frequencies
 * are taken as `blocks` of K_PAIRS. */
typedef struct {
    int points, sets, entries, blocks;
} Level;

/* n samples; its levels; tiles of the last one, whose rows are `stride` apart */
typedef struct {
    int n;
    Level first, second, last;
    int tiles, stride;
} Axis;

/* T_first and T_(first - 1) of t, doubling the order: T_2n = 2 T_n^2 - 1, T_(2n - 1) = 2 T_n T_(n-1) - t */
static INLINE void chebyshev(const double8 t, const int first, double8 *term, double8 *before) {
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

/* Rows and columns of eight vectors change places: halves, pairs and single lanes in turn. */
static INLINE void transpose8(REAL8 *m) {
    UNROLL for (int i = 0; i < 4; ++i) {
        const REAL8 a = m[i], b = m[i + 4];
        m[i] = (REAL8)(a.s0123, b.s0123);
        m[i + 4] = (REAL8)(a.s4567, b.s4567);
    }
    UNROLL for (int i = 0; i < 4; ++i) {
        const int k = (i & 1) + 2 * (i & 2);
        const REAL8 a = m[k], b = m[k + 2];
        m[k] = (REAL8)(a.s01, b.s01, a.s45, b.s45);
        m[k + 2] = (REAL8)(a.s23, b.s23, a.s67, b.s67);
    }
    UNROLL for (int i = 0; i < 4; ++i) {
        const REAL8 a = m[2 * i], b = m[2 * i + 1];
        m[2 * i] = (REAL8)(a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6);
        m[2 * i + 1] = (REAL8)(a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7);
    }
}

/* Terms first .. first + TERMS - 1 of DOUBLES samples t: out[sample][term]. */
static APART void terms_of(const double8 t, const int first, __global REAL *out) {
    double8 term, before;
    chebyshev(t, first, &term, &before);
    const double8 twice = 2.0 * t;
    ROLLED for (int n = 0; n < TERMS; n += 8) {
        REAL8 m[8];
        UNROLL for (int i = 0; i < 8; ++i) {
            m[i] = NAME(convert_, REAL8)(term);
            const double8 next = twice * term - before;
            before = term;
            term = next;
        }
        transpose8(m);
        UNROLL for (int i = 0; i < DOUBLES; ++i) vstore8(m[i], 0, out + i * TERMS + n);
    }
}

/* Point j of a level, times its turn; real points have none. */
static INLINE void point(__global const VECTOR *x, const long stride, const int parts, __global const REAL *turn,
                         const int j, VECTOR *p) {
    const VECTOR re = x[j * stride];
    p[0] = re;
    if (parts == 1) return;
    const VECTOR im = x[j * stride + 1];
    p[1] = im;
    const VECTOR c = turn[2 * j], s = turn[2 * j + 1];
    p[0] = fma(-s, im, c * re);
    p[1] = fma(s, re, c * im);
}

/* The sum and the difference of points j and k, of j alone where `alone`. */
static INLINE void pair(__global const VECTOR *x, const long stride, const int parts, __global const REAL *turn,
                        const int j, const int k, const int alone, VECTOR *sum, VECTOR *difference) {
    VECTOR p[PARTS], q[PARTS];
    point(x, stride, parts, turn, j, p);
    UNROLL for (int i = 0; i < parts; ++i) q[i] = 0;
    if (!alone) point(x, stride, parts, turn, k, q);
    UNROLL for (int i = 0; i < parts; ++i) {
        sum[i] = p[i] + q[i];
        difference[i] = p[i] - q[i];
    }
}

/* The points of a level, `stride` apart, as sums and differences [set][entry][sum, difference][part]. */
static INLINE void fold(__global const VECTOR *x, const long stride, const int parts, __global const REAL *turn,
                        const Level level, __global VECTOR *folded) {
    const int n = level.points, n_2 = n / 2;
    __global VECTOR *odd = folded + 2 * parts * level.entries;
    ROLLED for (int j = 0; j < level.entries; ++j, folded += 2 * parts, odd += 2 * parts) {
        VECTOR u[PARTS], v[PARTS], mirrored_u[PARTS], mirrored_v[PARTS];
        if (level.sets == 1) {
            pair(x, stride, parts, turn, j, n - j, j == 0, u, v);
            UNROLL for (int i = 0; i < parts; ++i) {
                folded[i] = u[i];
                folded[parts + i] = v[i];
            }
            continue;
        }
        pair(x, stride, parts, turn, j, j + n_2, 0, u, v);
        UNROLL for (int i = 0; i < parts; ++i) mirrored_u[i] = mirrored_v[i] = 0;
        if (j > 0 && 2 * j < n_2) pair(x, stride, parts, turn, n_2 - j, n - j, 0, mirrored_u, mirrored_v);
        UNROLL for (int i = 0; i < parts; ++i) {
            folded[i] = u[i] + mirrored_u[i];
            folded[parts + i] = u[i] - mirrored_u[i];
            odd[i] = v[i] - mirrored_v[i];
            odd[parts + i] = v[i] + mirrored_v[i];
        }
    }
}

static APART void fold_real(__global const VECTOR *x, const long stride, const Level level, __global VECTOR *folded) {
    fold(x, stride, 1, 0, level, folded);
}

static APART void fold_complex(__global const VECTOR *x, const long stride, __global const REAL *turn,
                               const Level level, __global VECTOR *folded) {
    fold(x, stride, PARTS, turn, level, folded);
}

/* A block of K_PAIRS frequencies: f[pair][k, -k][part]. */
static APART void sum_complex(__global const VECTOR *folded, __global const REAL *factors, const int entries,
                              VECTOR (*f)[2][PARTS]) {
    VECTOR c[K_PAIRS][PARTS], s[K_PAIRS][PARTS];
    UNROLL for (int k = 0; k < K_PAIRS; ++k) UNROLL for (int part = 0; part < PARTS; ++part) {
        c[k][part] = folded[part];
        s[k][part] = 0;
    }
    ROLLED for (int j = 1; j < entries; ++j, factors += 2 * K_PAIRS) {
        folded += 2 * PARTS;
        const VECTOR sum_re = folded[0], sum_im = folded[1], difference_re = folded[2], difference_im = folded[3];
        UNROLL for (int k = 0; k < K_PAIRS; ++k) {
            const VECTOR cosine = factors[2 * k], sine = factors[2 * k + 1];
            c[k][0] = fma(cosine, sum_re, c[k][0]);
            c[k][1] = fma(cosine, sum_im, c[k][1]);
            s[k][0] = fma(sine, difference_re, s[k][0]);
            s[k][1] = fma(sine, difference_im, s[k][1]);
        }
    }
    UNROLL for (int k = 0; k < K_PAIRS; ++k) {
        f[k][0][0] = c[k][0] - s[k][1];
        f[k][0][1] = c[k][1] + s[k][0];
        f[k][1][0] = c[k][0] + s[k][1];
        f[k][1][1] = c[k][1] - s[k][0];
    }
}

/* The same of real points, whose frequencies -k are not wanted. */
static APART void sum_real(__global const VECTOR *folded, __global const REAL *factors, const int entries,
                           VECTOR (*f)[2][PARTS]) {
    VECTOR c[K_PAIRS], s[K_PAIRS];
    UNROLL for (int k = 0; k < K_PAIRS; ++k) {
        c[k] = folded[0];
        s[k] = 0;
    }
    ROLLED for (int j = 1; j < entries; ++j, factors += 2 * K_PAIRS) {
        folded += 2;
        const VECTOR sum = folded[0], difference = folded[1];
        UNROLL for (int k = 0; k < K_PAIRS; ++k) {
            c[k] = fma((VECTOR)factors[2 * k], sum, c[k]);
            s[k] = fma((VECTOR)factors[2 * k + 1], difference, s[k]);
        }
    }
    UNROLL for (int k = 0; k < K_PAIRS; ++k) {
        f[k][0][0] = c[k];
        f[k][0][1] = s[k];
    }
}

/* Where the factors of the next level begin. */
static int factors_of(const Level level) { return level.sets * level.blocks * (level.entries - 1) * K_PAIRS * 2; }

/* Every frequency of a folded level, `stride` vectors apart; of real points, those up to half of the points. */
static INLINE void write_level(__global const VECTOR *folded, __global const REAL *factors, const Level level,
                               const int parts, __global VECTOR *to, const long stride) {
    const int each = (level.entries - 1) * K_PAIRS * 2;
    ROLLED for (int set = 0; set < level.sets; ++set, folded += 2 * parts * level.entries)
        ROLLED for (int block = 0; block < level.blocks; ++block, factors += each) {
            VECTOR f[K_PAIRS][2][PARTS];
            if (parts == 1) sum_real(folded, factors, level.entries, f);
            else sum_complex(folded, factors, level.entries, f);
            ROLLED for (int i = 0; i < K_PAIRS; ++i) {
                const int k = set + level.sets * (block * K_PAIRS + i);
                if (2 * k > level.points) break;
                to[k * stride] = f[i][0][0];
                to[k * stride + 1] = f[i][0][1];
                if (parts == 1 || k == 0 || 2 * k == level.points) continue;
                to[(level.points - k) * stride] = f[i][1][0];
                to[(level.points - k) * stride + 1] = f[i][1][1];
            }
        }
}

static APART void write_real(__global const VECTOR *folded, __global const REAL *factors, const Level level,
                             __global VECTOR *to, const long stride) {
    write_level(folded, factors, level, 1, to, stride);
}

static APART void write_complex(__global const VECTOR *folded, __global const REAL *factors, const Level level,
                                __global VECTOR *to, const long stride) {
    write_level(folded, factors, level, PARTS, to, stride);
}

/* The first and the second level of samples of one n3, `stride` apart: B[k][n3] at b, of real samples with k1 <= N1 / 2
 * alone. */
static INLINE void first_levels(__global const VECTOR *sample, const long stride, const int parts,
                                __global const REAL *factors, __global const REAL *turn, const Axis axis,
                                __global VECTOR *scratch, __global VECTOR *b) {
    const int n1 = axis.first.points, n2 = axis.second.points;
    __global VECTOR *a = n2 == 1 ? b : scratch, *folded = scratch + PARTS * n1 * n2;
    const long a_stride = PARTS * (n2 == 1 ? axis.stride : n2), b_stride = PARTS * axis.stride;
    ROLLED for (int j = 0; j < n2; ++j) {
        if (parts == 1) {
            fold_real(sample + j * stride, n2 * stride, axis.first, folded);
            write_real(folded, factors, axis.first, a + PARTS * j, a_stride);
        } else {
            fold_complex(sample + j * stride, n2 * stride, turn, axis.first, folded);
            write_complex(folded, factors, axis.first, a + PARTS * j, a_stride);
        }
    }
    if (n2 == 1) return;
    ROLLED for (int k1 = 0; k1 < (parts == 1 ? n1 / 2 + 1 : n1); ++k1) {
        fold_complex(a + k1 * a_stride, PARTS, turn + 2 * (n1 + k1 * n2), axis.second, folded);
        write_complex(folded, factors + factors_of(axis.first), axis.second, b + k1 * b_stride, n1 * b_stride);
    }
}

/* t of a row in order of n3: t[n3][n1 N2 + n2], whose rows are `length` apart. */
static APART void order_row(const long next, __global const double *row, const double scale, const Axis axis, const int length,
                            __global double *t) {
    int x = axis.n / 2;
    ROLLED for (int j = 0; j < axis.n / axis.last.points; ++j) {
        /* the row that a work-item takes next */
        ROLLED for (int i = 0; i < axis.last.points; i += DOUBLES) PREFETCH(row + next + j * axis.last.points + i);
        ROLLED for (int n3 = 0; n3 < axis.last.points; ++n3) {
            t[n3 * length + j] = scale * row[x];
            x = x + 1 < axis.n ? x + 1 : 0;
        }
    }
}

__kernel void along_x(__global const double *heights, const double scale, const int first,
                      __global const REAL *factors, __global const REAL *turn, __global const int *of,
                      __global const int *place, const Axis axis, const int2 rows, const int strip, const int2 along,
                      const int tall, __global VECTOR *scratch, const long room, __global VECTOR *narrow) {
    const int points = axis.first.points * axis.second.points, n3 = axis.last.points;
    __global VECTOR *b = scratch + get_global_id(0) * room, *sample = b + PARTS * GROUPS * points * axis.stride;
    /* whole vectors of samples */
    const int length = DOUBLES * ((points + DOUBLES - 1) / DOUBLES);
    __global VECTOR *own = sample + GROUPS * length, *folded = own;
    __global double *t = (__global double *)(scratch + (get_global_id(0) + 1) * room) - n3 * length;
    __global const REAL *last = factors + factors_of(axis.first) + factors_of(axis.second);
    __global const REAL *last_turn = turn + 2 * (axis.first.points + points);
    const int each = (axis.last.entries - 1) * K_PAIRS * 2;

    ROLLED for (int i = 0; i < n3 * length; ++i) t[i] = 0.0;
    const int ny = rows.x * rows.y;
    const long next = (long)rows.y * along.y * axis.n * get_global_size(0);
    ROLLED for (int at = get_global_id(0); at < rows.x; at += get_global_size(0)) {
        const int y = (at % along.x * along.y + at / along.x) * rows.y + strip;
        order_row(next, heights + (long)((y + ny / 2) % ny) * axis.n, scale, axis, length, t);
        ROLLED for (int j = 0; j < n3; ++j) {
            ROLLED for (int i = 0; i < length; i += DOUBLES)
                terms_of(vload8(0, t + j * length + i), first, (__global REAL *)(sample + i * GROUPS));
            ROLLED for (int g = 0; g < GROUPS; ++g)
                first_levels(sample + g, GROUPS, 1, factors, turn, axis, own,
                             b + PARTS * (g * points * axis.stride + j));
        }
        ROLLED for (int tile = 0; tile < axis.tiles * GROUPS; ++tile) {
            const int t = tile / GROUPS, g = tile % GROUPS, k = of[t];
            fold_complex(b + PARTS * (g * points + k) * axis.stride, PARTS, last_turn + 2 * k * n3, axis.last, folded);
            ROLLED for (int block = 0; block < axis.last.sets * axis.last.blocks; ++block) {
                const int set = block / axis.last.blocks;
                VECTOR f[K_PAIRS][2][PARTS];
                sum_complex(folded + 2 * PARTS * axis.last.entries * set, last + block * each, axis.last.entries, f);
                __global const int *columns = place + (t * axis.last.sets * axis.last.blocks + block) * K_PAIRS * 2;
                ROLLED for (int i = 0; i < 2 * K_PAIRS; ++i) {
                    const int negative = columns[i] < -1, column = negative ? -2 - columns[i] : columns[i];
                    if (column < 0) continue;
                    __global VECTOR *to = narrow + (((long)column * tall + at) * GROUPS + g) * PARTS;
                    STREAM(f[i / 2][i % 2][0], to);
                    STREAM(negative ? -f[i / 2][i % 2][1] : f[i / 2][i % 2][1], to + 1);
                }
            }
        }
    }
}

/* A coefficient's real and imaginary parts, which are `terms` apart; the first `lit` terms of either. Those of a later
 * strip are added to what is there. Whole lines of the cache are written one after the other. */
static INLINE void store_terms(VECTOR (*of)[PARTS], const int sign, const int lit, const int terms, const int strip,
                               __global REAL *to) {
    UNROLL for (int part = 0; part < PARTS; ++part, to += terms) {
        const int negative = part == 1 && sign < 0;
        if (lit == TERMS && terms % TERMS == 0) UNROLL for (int g = 0; g < GROUPS; ++g) {
            __global VECTOR *at = (__global VECTOR *)to + g;
            const VECTOR value = negative ? -of[g][part] : of[g][part];
            if (strip) *at += value;
            else STREAM(value, at);
        } else ROLLED for (int n = 0; n < lit; ++n) {
            const REAL value = ((const REAL *)&of[n / WIDTH][part])[n % WIDTH];
            to[n] = (strip ? to[n] : 0) + (negative ? -value : value);
        }
    }
}

/* Where the stack holds a coefficient of phi >= 0, or its negative where `side` is 1. */
static long place_of(const int row, const int phi, const int side, const int rows, const int reach, const long width) {
    return side ? (rows - 1 - row) * width + reach - phi : row * width + reach + phi;
}

__kernel void along_y(__global const VECTOR *narrow, __global const REAL *factors, __global const REAL *turn,
                      __global const int *of, __global const int *place, const Axis axis, const int columns,
                      const int tall, __global VECTOR *scratch, const long room, const int first, const int terms,
                      const int reach, const int phi_max, const int rows, __global const REAL *shift, const int strip,
                      __global REAL *stack) {
    const int points = axis.first.points * axis.second.points, n3 = axis.last.points, lit = min(terms - first, TERMS);
    __global VECTOR *b = scratch + get_global_id(0) * room, *own = b + PARTS * GROUPS * points * axis.stride;
    __global const REAL *last = factors + factors_of(axis.first) + factors_of(axis.second);
    __global const REAL *last_turn = turn + 2 * (axis.first.points + points);
    const int each = (axis.last.entries - 1) * K_PAIRS * 2, folded = 2 * PARTS * axis.last.entries;
    const long width = reach + phi_max + 1;

    ROLLED for (int phi = get_global_id(0); phi < columns; phi += get_global_size(0)) {
        /* small phi is stored at -phi, too */
        const int from = phi > phi_max, to = phi > 0 && phi <= reach ? 2 : 1;
        __global const VECTOR *sample = narrow + (long)phi * tall * GROUPS * PARTS;
        ROLLED for (int j = 0; j < n3; ++j) {
            __global const VECTOR *next = sample + PARTS * GROUPS * (j + 1) * points;
            ROLLED for (int i = 0; i < PARTS * GROUPS * points; i += GROUPS) PREFETCH(next + i);
            ROLLED for (int g = 0; g < GROUPS; ++g)
                first_levels(sample + PARTS * (GROUPS * j * points + g), PARTS * GROUPS, PARTS, factors, turn, axis,
                             own, b + PARTS * (g * points * axis.stride + j));
        }
        ROLLED for (int t = 0; t < axis.tiles; ++t) {
            const int k = of[t];
            ROLLED for (int g = 0; g < GROUPS; ++g)
                fold_complex(b + PARTS * (g * points + k) * axis.stride, PARTS, last_turn + 2 * k * n3, axis.last,
                             own + g * axis.last.sets * folded);
            ROLLED for (int block = 0; block < axis.last.sets * axis.last.blocks; ++block) {
                const int set = block / axis.last.blocks;
                __global const int *to_rows = place + (t * axis.last.sets * axis.last.blocks + block) * K_PAIRS * 2;
                /* what is there already is asked for while the sums before it are made */
                if (strip && (t + 1 < axis.tiles || block + 1 < axis.last.sets * axis.last.blocks))
                    ROLLED for (int i = 2 * K_PAIRS; i < 4 * K_PAIRS; ++i) {
                        if (to_rows[i] < 0) continue;
                        ROLLED for (int row = to_rows[i]; row < rows; row += axis.n)
                            ROLLED for (int side = from; side < to; ++side) {
                                const long at = place_of(row, phi, side, rows, reach, width);
                                PREFETCH(stack + at * PARTS * terms + first);
                                PREFETCH(stack + (at * PARTS + 1) * terms + first);
                            }
                    }
                VECTOR f[GROUPS][K_PAIRS][2][PARTS];
                ROLLED for (int g = 0; g < GROUPS; ++g)
                    sum_complex(own + (g * axis.last.sets + set) * folded, last + block * each, axis.last.entries,
                                f[g]);
                ROLLED for (int i = 0; i < 2 * K_PAIRS; ++i) {
                    if (to_rows[i] < 0) continue;
                    ROLLED for (int row = to_rows[i]; row < rows; row += axis.n) {
                        const VECTOR c = shift[PARTS * row], s = shift[PARTS * row + 1];
                        VECTOR turned[GROUPS][PARTS];
                        UNROLL for (int g = 0; g < GROUPS; ++g) {
                            const VECTOR re = f[g][i / 2][i % 2][0], im = f[g][i / 2][i % 2][1];
                            turned[g][0] = fma(-s, im, c * re);
                            turned[g][1] = fma(s, re, c * im);
                        }
                        ROLLED for (int side = from; side < to; ++side) {
                            const long at = place_of(row, phi, side, rows, reach, width);
                            store_terms(turned, side ? -1 : 1, lit, terms, strip, stack + at * PARTS * terms + first);
                        }
                    }
                }
            }
        }
    }
}
