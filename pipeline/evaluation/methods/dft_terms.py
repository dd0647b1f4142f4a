"""The precomputed DFT terms of [S14] alg. 1 and their look-up, which FLSS, NMM and PQ share.

Alg. 1 transforms (i h)^n, n = 0 .. T, and stores real and imaginary parts of each term normalised to [0, 1] between
its extremes (eq. 1.1), which the look-up undoes. Where this departs from the thesis it follows the project:

- the patch's middle sample is the origin, not pixel 0, where the window's bright middle would lie on the patch's
  seam;
- heights are centred at mid-range, which changes no intensity and halves the largest phase, so fewer terms do;
- powers are of t = h / H. Eq. 1.1 removes any unit from stored values, so this changes the extremes only: of order
  1 instead of um^n, and no power leaves floating point's range;
- the transform carries Stam's sign, exp(+2 pi i f.x), and is divided by the number of samples: a mirror gives 1;
- only frequencies that light can reach, |f| <= 2 / lambda_min, are kept. Extremes are those of the whole transform.

The price of eq. 1.1: a term keeps 3e-8 of its extent, most of which is its value at f = 0. Coefficients far from the
mirror direction keep fewer digits than floats would. On *Elaphe*, 7e-6 of XYZ or of 1e-7 of a mirror's, in the mean.
"""

from dataclasses import dataclass
from math import ceil, floor, pi

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft2

from kernels import thesis_lookup
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction import expansion
from pipeline.diffraction.device import require_device
from pipeline.optics.coherence import reach_sigmas, sigma_f
from pipeline.surface.heightfield import HeightField

# of exp(i k w h) at the worst sample: the Taylor series' remainder where no number of terms is given
SERIES_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Coefficients:
    """A reach of a number of coefficients on either side of the anchor."""

    count: int


@dataclass(frozen=True)
class Sigmas:
    """A reach of at least a number of sigma_f on either side of the position."""

    count: float


Reach = Coefficients | Sigmas
# the published code's reach, and that of [S14] 1.3.2's text; on 65 um = 4 sigma a sigma_f is 0.64 coefficients
THREE_BY_THREE = Coefficients(1)
FOUR_SIGMA = Sigmas(4.0)
# the window's transform to 1e-6 of its peak
FULL = Sigmas(reach_sigmas(1e-6))


@dataclass(frozen=True)
class DftTerms:
    """D_n[psi, phi] = mean(i^n t^n exp(+2 pi i (phi x + psi y))) = least + span * normalised.

    normalised: float32 (rows, columns, 2, terms) in [0, 1]: real and imaginary part, terms side by side.
    least, span: float64 (2, terms): a term's minimum, and its maximum less that.
    zero: (row, column) of f = 0. spacing_per_um: (x, y), 1/um: one over the patch's size.
    """

    normalised: NDArray[np.float32]
    least: Array
    span: Array
    zero: tuple[int, int]
    spacing_per_um: tuple[float, float]


def transform(field: HeightField, terms: int, kept: tuple[int, int]) -> DftTerms:
    """The terms n < `terms` of a height field at -kept .. kept coefficients (x, y) from f = 0."""
    field = field.centred()
    ny, nx = field.shape
    columns, rows = (np.arange(-k, k + 1) % n for k, n in zip(kept, (nx, ny), strict=True))
    # the middle sample becomes sample 0
    t = np.roll(field.heights_um / max(field.half_range_um, 1e-300), (-(ny // 2), -(nx // 2)), axis=(0, 1))
    normalised = np.empty((len(rows), len(columns), 2, terms), np.float32)
    least, span = np.empty((2, terms)), np.empty((2, terms))
    power = np.ones_like(t)
    for n in range(terms):
        whole = 1j ** (n % 4) * ifft2(power, workers=-1)
        for part, values in enumerate((whole.real, whole.imag)):
            least[part, n] = values.min()
            span[part, n] = values.max() - least[part, n]
            # a term without extent, a mirror's, is its least value everywhere
            scale = 1.0 / span[part, n] if span[part, n] > 0.0 else 0.0
            normalised[..., part, n] = scale * (values[np.ix_(rows, columns)] - least[part, n])
        power *= t
    width, height = field.size_um
    return DftTerms(normalised, least, span, (kept[1], kept[0]), (1.0 / width, 1.0 / height))


class Lookup:
    """|P|^2 from the terms of one height field by a neighbourhood around s(f) = f N dH ([S14] eq. 1.5-1.10)."""

    def __init__(self, field: HeightField, config: Config, terms: int | None, reach: Reach) -> None:
        """`terms`: T + 1; None takes enough to leave `SERIES_TOLERANCE` of exp(i k w h).

        Raises DeviceError where no device works.
        """
        require_device()
        lambda_min = config.light.lambda_min_nm
        if terms is None:
            z = expansion.largest_phase(field.half_range_um, lambda_min)
            terms = 1 + expansion.taylor_order(z, SERIES_TOLERANCE)
        self._half_range_um = field.half_range_um
        self._band = field.band_limit_per_um
        self._highest = expansion.W_MAX / (1e-3 * lambda_min)
        sigma_um, size_um = config.coherence.sigma_um, field.size_um
        taps_x, taps_y = (_taps(reach, size, sigma_um) for size in size_um)
        kept_x, kept_y = (
            floor(min(self._highest, band) * size) for band, size in zip(self._band, size_um, strict=True)
        )
        # floor puts the anchor one below the lowest position
        built = transform(field, terms, (kept_x + 1 + taps_x, kept_y + 1 + taps_y))
        self.terms = terms
        self.stored_bytes = built.normalised.nbytes + built.least.nbytes + built.span.nbytes
        of = built.normalised, built.least, built.span, built.zero, built.spacing_per_um
        self._device = thesis_lookup.upload_terms(*of, (taps_x, taps_y), sigma_f(sigma_um))

    def at_pairs(self, weight: thesis_lookup.Weight, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (pairs,) of `uvw` (pairs, 3) at `lambda_nm` (pairs,); NaN beyond the Nyquist limits.

        Raises ValueError for wavelengths shorter than the config's.
        """
        lambda_um = 1e-3 * lambda_nm
        fx, fy = uvw[:, 0] / lambda_um, uvw[:, 1] / lambda_um
        known = (np.abs(fx) <= self._band[0]) & (np.abs(fy) <= self._band[1])
        fx, fy, phase = fx[known], fy[known], (2.0 * pi * self._half_range_um) * (uvw[:, 2] / lambda_um)[known]
        if np.any(np.maximum(np.abs(fx), np.abs(fy)) > self._highest * (1.0 + 1e-9)):
            raise ValueError(
                f"terms are kept up to {self._highest:.4g} / um: a wavelength is shorter than the config's"
            )
        power = np.full(len(uvw), np.nan)
        power[known] = thesis_lookup.power(self._device, weight, fx, fy, phase)
        return power

    def power(self, weight: thesis_lookup.Weight, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L) of every direction (directions, 3) at every wavelength (L,), as `at_pairs`."""
        pairs = self.at_pairs(weight, np.repeat(uvw, len(lambda_nm), axis=0), np.tile(lambda_nm, len(uvw)))
        return pairs.reshape(len(uvw), len(lambda_nm))


def _taps(reach: Reach, size_um: float, sigma_um: float) -> int:
    """Coefficients on either side of the anchor. The position lies up to one above it: that side gets the fewer."""
    if isinstance(reach, Coefficients):
        return reach.count
    return ceil(reach.count * sigma_f(sigma_um) * size_um)
