"""Which kernels are built together: a build costs the compiler a tenth of a second, whatever is in it."""

from kernels import device

# Bounds of what a work-item keeps, wide enough for surfaces 10 um tall; what is taller takes a program of its own.
_MOST_BLOCKS = 16  # of 16 Chebyshev terms
_MOST_S_NODES = 512
MOST_W_TERMS = 136  # a config may ask for 128, and planning looks a few further
# coefficients under a window along an axis: 2e-11 on a patch of thirty sigma, the widest of a stack, takes 69
MOST_TAPS = 69

LANES = 16  # azimuths of a tile, and terms of a block: floats of a line of the cache
CHANNELS = 3  # X, Y and Z
ORDER = 8  # nodes of every interpolation of the spectral operator, over r and along kappa
MOST_RINGS = 8  # of a group of rings, whose sums stay in the nearest cache


def polar(term_blocks: int = 0, s_nodes: int = 0, w_terms: int = 0) -> device.Program:
    """The kernels of a polar table, in single precision.

    term_blocks, s_nodes, w_terms: blocks of 16 Chebyshev terms, nodes in s and terms in |w| that it must hold.
    """
    constants = {
        **_stack("float", 4),
        **device.default_device().blocks.chosen("USUAL_TAPS", "NODES", "W_BLOCK", "XYZ_VECTORS"),
        "LANES": LANES,
        "MOST_BLOCKS": device.bound(term_blocks, _MOST_BLOCKS),
        "MOST_S_NODES": device.bound(s_nodes, _MOST_S_NODES),
        "MOST_W_TERMS": device.bound(w_terms, MOST_W_TERMS),
        "MOST_TAPS": MOST_TAPS,
        "ORDER": ORDER,
        "MOST_RINGS": MOST_RINGS,
    }
    files = "dft_stack.cl", "polar_power_spectrum.cl", "spectral_operator.cl", "cubic_spline.cl"
    return device.program(files, constants)


def exact() -> device.Program:
    """The kernels of the exact reference, in double precision."""
    return device.program(("dft_stack.cl", "exact_power.cl"), {**_stack("double", 8), "MOST_TAPS": MOST_TAPS})


def _stack(real: str, itemsize: int) -> dict[str, int | str]:
    """Constants of dft_stack.cl."""
    blocks = device.default_device().blocks
    return {"REAL": real, "WIDTH": blocks.lanes(itemsize), **blocks.chosen("K_PAIRS")}
