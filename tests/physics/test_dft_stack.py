"""The stack's kernel against sums written out: every frequency, both series, sizes with and without small factors."""

import numpy as np
import pytest

from kernels import device
from kernels.dft_stack import Kept, transform


def silent(_done):
    """Nobody listens."""


def sums(heights, scale, series, kept, terms):
    """mean(term_n exp(+2 pi i f.x)) by matrices of waves, x and y from the middle sample: (psi, phi, terms)."""
    t, n = scale * heights, np.arange(terms)[:, None, None]
    term = np.cos(n * np.arccos(np.clip(t, -1.0, 1.0))) if series == "chebyshev" else t**n
    ny, nx = heights.shape
    psi = np.arange(-kept.psi_max, kept.psi_max + 1)
    phi = np.arange(-kept.reach, kept.phi_max + 1)
    along_y = np.exp(2j * np.pi / ny * np.outer(psi, np.arange(ny) - ny // 2))
    along_x = np.exp(2j * np.pi / nx * np.outer(phi, np.arange(nx) - nx // 2))
    return np.einsum("py,nyx,qx->pqn", along_y, term, along_x, optimize=True) / heights.size


@pytest.mark.parametrize(("ny", "nx"), [(36, 30), (37, 41), (1, 64), (35, 1), (2, 3), (74, 53)], ids=lambda n: str(n))
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 1e-6), (np.float64, 1e-14)])
@pytest.mark.parametrize("series", ["chebyshev", "taylor"])
def test_equals_the_sums_written_out(ny, nx, dtype, tolerance, series):
    heights = np.random.default_rng(ny + nx).uniform(-0.3, 0.3, (ny, nx))
    # frequencies beyond half the samples wrap; the reach may be wider than what is asked for
    kept, terms = Kept(psi_max=ny // 2 + 2, phi_max=nx // 2, reach=nx // 2 + 3), 19
    out = device.empty((*kept.shape, 2, terms), dtype)
    transform(heights, 1.0 / 0.3, series, kept, out, silent)
    found = out[:, :, 0] + 1j * out[:, :, 1]
    assert np.max(np.abs(found - sums(heights, 1.0 / 0.3, series, kept, terms))) < tolerance


def test_two_hundred_terms_keep_their_digits():
    """Each vector of terms begins anew, at cos(n acos t): errors do not grow with n squared."""
    heights = np.random.default_rng(1).uniform(-1.0, 1.0, (24, 24))
    heights[0, 0], heights[0, 1] = 1.0, -1.0
    kept = Kept(2, 2, 1)
    out = device.empty((*kept.shape, 2, 200), np.float64)
    told = []
    transform(heights, 1.0, "chebyshev", kept, out, told.append)
    found = out[:, :, 0] + 1j * out[:, :, 1]
    assert np.max(np.abs(found - sums(heights, 1.0, "chebyshev", kept, 200))) < 1e-12
    assert told == sorted(told)
    assert told[-1] == 1.0
