"""The stack's transforms by two algorithms, kernel and FFTW, against explicit sums and against each other."""

import numpy as np
import pytest

from kernels import device, dft_stack, factored_axis
from kernels.dft_stack import Kept
from pipeline.fourier import term_transforms

SIZES = pytest.mark.parametrize(
    ("ny", "nx"), [(36, 30), (37, 41), (1, 64), (35, 1), (2, 3), (74, 53)], ids=lambda n: str(n)
)
PRECISIONS = pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 1e-6), (np.float64, 1e-14)])
SCALE_PER_UM = 1.0 / 0.3


def silent(_done):
    """Ignores progress."""


def heights_of(ny, nx):
    return np.random.default_rng(ny + nx).uniform(-0.3, 0.3, (ny, nx))


def kept_of(ny, nx):
    """Frequencies beyond half the samples wrap; the reach may exceed the highest frequency."""
    return Kept(psi_max=ny // 2 + 2, phi_max=nx // 2, reach=nx // 2 + 3)


def terms_of(t, series, terms):
    """T_n(t) or t^n, (terms, ny, nx)."""
    n = np.arange(terms)[:, None, None]
    return np.cos(n * np.arccos(np.clip(t, -1.0, 1.0))) if series == "chebyshev" else t**n


def sums(heights, scale, series, kept, terms):
    """mean(term_n exp(+2 pi i f.x)) (psi, phi, terms) by matrices of waves; x and y count from the middle sample."""
    ny, nx = heights.shape
    psi = np.arange(-kept.psi_max, kept.psi_max + 1)
    phi = np.arange(-kept.reach, kept.phi_max + 1)
    along_y = np.exp(2j * np.pi / ny * np.outer(psi, np.arange(ny) - ny // 2))
    along_x = np.exp(2j * np.pi / nx * np.outer(phi, np.arange(nx) - nx // 2))
    term = terms_of(scale * heights, series, terms)
    return np.einsum("py,nyx,qx->pqn", along_y, term, along_x, optimize=True) / heights.size


def by_kernel(heights, scale, series, kept, terms, dtype, progress=silent):
    assert series == "chebyshev"
    out = device.empty((*kept.shape, 2, terms), dtype)
    dft_stack.transform(heights, scale, kept, out, progress)
    return out[:, :, 0] + 1j * out[:, :, 1]


def by_fftw(heights, scale, series, kept, terms, dtype):
    out = np.full((*kept.shape, 2, terms), np.nan, dtype)
    t = scale * np.fft.ifftshift(heights)
    term_transforms.transform(terms_of(t, series, terms), kept, out)
    return out[:, :, 0] + 1j * out[:, :, 1]


@SIZES
@PRECISIONS
@pytest.mark.parametrize(
    ("algorithm", "series"), [(by_kernel, "chebyshev"), (by_fftw, "chebyshev"), (by_fftw, "taylor")]
)
def test_transforms_equal_explicit_sums(algorithm, ny, nx, dtype, tolerance, series):
    heights, kept, terms = heights_of(ny, nx), kept_of(ny, nx), 19
    found = algorithm(heights, SCALE_PER_UM, series, kept, terms, dtype)
    assert np.max(np.abs(found - sums(heights, SCALE_PER_UM, series, kept, terms))) < tolerance


@pytest.mark.parametrize(
    ("ny", "nx"), [(360, 288), (257, 331), (243, 500), (8100, 5), (3, 8192)], ids=lambda n: str(n)
)
@PRECISIONS
def test_the_kernel_and_fftw_agree(ny, nx, dtype, tolerance):
    """At sizes for which sums take long: composite, prime, even and odd, long; a part of the frequencies is kept."""
    of = heights_of(ny, nx), SCALE_PER_UM, "chebyshev", Kept(psi_max=ny // 5, phi_max=nx // 6, reach=4), 33, dtype
    difference = by_kernel(*of) - by_fftw(*of)
    assert np.max(np.abs(difference)) < tolerance


@PRECISIONS
@pytest.mark.parametrize(("ny", "strips"), [(36, 2), (36, 4), (35, 5), (37, 1)])
def test_strips_of_rows_add_up(monkeypatch, ny, strips, dtype, tolerance):
    """More frequencies may be kept than a strip has samples; a prime number of rows is one strip."""
    kept = kept_of(ny, 30)
    monkeypatch.setattr(dft_stack, "_MOST_STRIPS", 5)
    monkeypatch.setattr(dft_stack, "_MOST_BETWEEN_BYTES", dft_stack.between_bytes(kept, ny // strips))
    assert dft_stack.between_bytes(kept, ny) == dft_stack.between_bytes(kept, ny // strips)
    test_transforms_equal_explicit_sums(by_kernel, ny, 30, dtype, tolerance, "chebyshev")


@pytest.mark.parametrize("width", [4, 8, 16])
def test_vectors_of_any_processor_hold_the_terms(monkeypatch, width):
    """Two to eight doubles of a register."""
    monkeypatch.setattr(device.default_device().blocks, "vector_width", width)
    test_transforms_equal_explicit_sums(by_kernel, 24, 30, np.float64, 1e-14, "chebyshev")


def test_two_hundred_terms_are_as_accurate_as_few():
    """The recurrence restarts in each vector of terms by doubling the order, so errors do not grow with the order."""
    heights = np.random.default_rng(1).uniform(-1.0, 1.0, (24, 24))
    heights[0, 0], heights[0, 1] = 1.0, -1.0
    kept, reports = Kept(2, 2, 1), []
    found = by_kernel(heights, 1.0, "chebyshev", kept, 200, np.float64, reports.append)
    assert np.max(np.abs(found - sums(heights, 1.0, "chebyshev", kept, 200))) < 1e-12
    assert reports == sorted(reports)
    assert reports[-1] == 1.0


@pytest.mark.parametrize(("samples", "most"), [(1332, 60), (8192, 70), (8100, 75)])
def test_operations_a_sample_hardly_grow_with_samples(samples, most):
    """Multiply-adds of complex samples, two for each factor, where a quarter of the frequencies is kept."""
    first, second, last = factored_axis.of_complex(samples, samples // 4, 3).levels
    of = [2 * level.factors().size / level.points for level in (first, second, last)]
    assert first.points * second.points * last.points == samples
    assert sum(of) < most


@pytest.mark.parametrize("cores", [1, 3, 64, None])
def test_terms_do_not_depend_on_how_many_are_transformed_at_once(monkeypatch, cores):
    """Nor on the generator overwriting a term's array when the next one is requested."""
    heights, kept, terms = heights_of(30, 28), Kept(7, 6, 3), 11
    expected = by_fftw(heights, SCALE_PER_UM, "taylor", kept, terms, np.float64)
    monkeypatch.setattr("os.cpu_count", lambda: cores)

    def written_over():
        term = np.empty(heights.shape)
        for each in terms_of(SCALE_PER_UM * np.fft.ifftshift(heights), "taylor", terms):
            term[...] = each
            yield term
            term[...] = np.nan

    out, reports = np.empty((*kept.shape, 2, terms)), []
    term_transforms.transform(written_over(), kept, out, lambda stage, done: reports.append((stage, done)))
    np.testing.assert_array_equal(out[:, :, 0] + 1j * out[:, :, 1], expected)
    assert reports == sorted(reports)
    assert reports[-1] == ("stack", 1.0)
