"""Which kernels are built together: a build costs the compiler a tenth of a second, whatever is in it."""

from kernels import device

# Bounds of what a work-item keeps, wide enough for surfaces 10 um tall; what is taller takes a program of its own.
_MOST_BLOCKS = 16  # of 16 Chebyshev terms
_MOST_S_NODES = 512
_MOST_W_TERMS = 136  # a config may ask for 128, and planning looks a few further
# coefficients under a window along an axis: 2e-11 on a patch of thirty sigma, the widest of a stack, takes 69
MOST_TAPS = 69

MOST_PAIRS = 128  # of samples and their mirror images in the first step of a transform: n1 / 2 + 1 of n = n1 n2
CHANNELS = 3  # X, Y and Z
ORDER = 8  # nodes of every interpolation of the spectral operator, over r and along kappa
MOST_RINGS = 8  # of a group of rings, whose sums stay in the nearest cache


def polar(term_blocks: int = 0, s_nodes: int = 0, w_terms: int = 0) -> device.Program:
    """The kernels of a polar table, in single precision.

    term_blocks, s_nodes, w_terms: blocks of 16 Chebyshev terms, nodes in s and terms in |w| that it must hold.
    """
    constants = {
        **_stack("float", 16),
        **device.default_device().blocks.chosen("USUAL_TAPS", "W_BLOCK"),
        "MOST_BLOCKS": device.bound(term_blocks, _MOST_BLOCKS),
        "MOST_S_NODES": device.bound(s_nodes, _MOST_S_NODES),
        "MOST_W_TERMS": device.bound(w_terms, _MOST_W_TERMS),
        "MOST_TAPS": MOST_TAPS,
        "ORDER": ORDER,
        "MOST_RINGS": MOST_RINGS,
    }
    files = "dft_stack.cl", "polar_power_spectrum.cl", "spectral_operator.cl", "cubic_spline.cl"
    return device.program(files, constants)


def exact() -> device.Program:
    """The kernels of the exact reference, in double precision."""
    return device.program(("dft_stack.cl", "exact_power.cl"), {**_stack("double", 8), "MOST_TAPS": MOST_TAPS})


def _stack(real: str, lanes: int) -> dict[str, int | str]:
    """Constants of dft_stack.cl, whose vectors of `lanes` numbers have 64 bytes."""
    sizes = device.default_device().blocks.chosen("STEP", "KEPT")
    return {"REAL": real, "LANES": lanes, "MOST_PAIRS": MOST_PAIRS, **sizes}
