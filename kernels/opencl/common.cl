/* What kernels share: directives, names of numbers, a window's weights and sums over lanes. Each file that uses it
 * includes it; kernels/source.py puts it in front once.
 */

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

/* Sums over these loops stay in registers only where the loops are written out. */
#define UNROLL _Pragma("unroll")
/* Copies of other loops' bodies would cost compiling time and win nothing. */
#define ROLLED _Pragma("nounroll")
/* Part of its caller, whose constants it needs. */
#define INLINE __attribute__((always_inline))
/* Compiled on its own, called where its loops begin: the compiler's time grows faster than a body's length. */
#define APART __attribute__((noinline))

#define JOIN(a, b) a##b
#define NAME(a, b) JOIN(a, b)

#define CHANNELS 3  /* X, Y and Z */
#define PARTS 2     /* the real and the imaginary part */
#define HALVES 2    /* a tile of azimuths and the tile half a turn on */
#define DOUBLES 8   /* in a vector of 64 bytes */
#define MODES 3     /* real factors of coefficients that stand for three windows along an axis */

/* The frequencies of a DFT stack and the coherence window's transform, exp(-f^2 / (2 sigma_f^2)). */
typedef struct {
    double dfx, dfy;            /* spacing of the DFT's frequencies, 1/um */
    double inverse_2_variance;  /* 1 / (2 sigma_f^2), um^2 */
    int columns;                /* of the stack */
    int row_zero, column_zero;  /* of f = 0 */
} Grid;

/* exp(-(d - j df)^2 / (2 sigma_f^2)), j = -reach .. reach, by multiplications alone, from
 *   peak = exp(-d^2 / (2 sigma_f^2)),  ratio = exp(d df / sigma_f^2),  decay_j = exp(-(j df)^2 / (2 sigma_f^2)).
 * VECTOR_TYPE is REAL_TYPE or a vector of it, with a d in each lane. */
#define WINDOW_WEIGHTS(name, VECTOR_TYPE, REAL_TYPE)                                                                   \
    static INLINE void name(const VECTOR_TYPE peak, const VECTOR_TYPE ratio, __global const REAL_TYPE *decay,          \
                            const int reach, VECTOR_TYPE *weight) {                                                    \
        const VECTOR_TYPE back = (REAL_TYPE)1 / ratio;                                                                 \
        VECTOR_TYPE up = peak, down = peak;                                                                            \
        weight[reach] = peak;                                                                                          \
        ROLLED for (int j = 1; j <= reach; ++j) {                                                                      \
            up *= ratio;                                                                                               \
            down *= back;                                                                                              \
            weight[reach + j] = up * decay[reach + j];                                                                 \
            weight[reach - j] = down * decay[reach - j];                                                               \
        }                                                                                                              \
    }

static double total(const double8 x) {
    const double4 half_sum = x.lo + x.hi;
    return (half_sum.x + half_sum.y) + (half_sum.z + half_sum.w);
}
