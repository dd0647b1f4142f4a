"""NMM of [S14] 1.5.2: only the wavelengths whose frequency lands on a DFT coefficient.

Coefficients lie at f = n / X, X = N dH the patch's width. A direction with (u, v) passes f = u / lambda, so
lambda_n = X |u| / n, n from X |u| / lambda_max to X |u| / lambda_min, is a set of wavelengths along u, and X |v| / n
one along v. ([S14] writes dH, the pixel's size, where the patch's width is meant: with a pixel of 0.1 um no n would
be left.) |P|^2 there is FLSS's.

[S14] sums over both sets and notes that they are not even. Here both are joined and each wavelength counts for the
stretch of the range that is nearer to it than to any other: a quadrature of the same integral, which it becomes as
coefficients crowd together. Unweighted, with the sums of the weights divided out, blue light counts for more, for
coefficients crowd as X |u| / lambda^2: on *Elaphe* 3.9 instead of 1.3 mean dE at 7500 RU, the middle left out.

Near (u, v) = 0 no coefficient but the mirror's own is met, and [S14] answers white inside a small circle. Here it is
white as a mirror is, |P|^2 = 1, and by default within lambda_max / X of the mirror direction: outside it at least
one wavelength lands along some axis wherever lambda_max >= 2 lambda_min, as 380 to 780 nm have it. Where none does it
is dark.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.dft_terms import FOUR_SIGMA, Lookup, Reach
from pipeline.evaluation.methods.method import Method, integrated, spread
from pipeline.optics.light import FINE_STEP_NM
from pipeline.surface.heightfield import HeightField


@dataclass(frozen=True)
class Selection:
    """Wavelengths chosen for directions, one pair after the other.

    direction: int64 (pairs,), ascending. lambda_nm: (pairs,), ascending within a direction. share_nm: (pairs,), the
    stretch of the range that a wavelength counts for.
    """

    direction: NDArray[np.int64]
    lambda_nm: Array
    share_nm: Array


def landing(uv: Array, size_um: tuple[float, float], range_nm: tuple[float, float]) -> Selection:
    """The wavelengths of directions with `uv` (directions, 2) that land on coefficients of either axis."""
    found = [_along_axis(1e3 * size * np.abs(uv[:, axis]), range_nm) for axis, size in enumerate(size_um)]
    direction, lambda_nm = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((lambda_nm, direction))
    direction, lambda_nm = direction[order], lambda_nm[order]
    return Selection(direction, lambda_nm, _shares(direction, lambda_nm, range_nm))


def _along_axis(path_nm: Array, range_nm: tuple[float, float]) -> tuple[NDArray[np.int64], Array]:
    """(direction, lambda = path / n) for all whole n with lambda in the range; `path_nm` (directions,) is X |u|."""
    low, high = range_nm
    first = np.maximum(np.ceil(path_nm / high), 1.0).astype(np.int64)
    count = np.maximum(np.floor(path_nm / low).astype(np.int64) - first + 1, 0)
    direction = np.repeat(np.arange(len(path_nm)), count)
    # 0, 1, ... within each direction
    step = np.arange(len(direction)) - np.repeat(np.cumsum(count) - count, count)
    return direction, path_nm[direction] / (first[direction] + step)


def _shares(direction: NDArray[np.int64], lambda_nm: Array, range_nm: tuple[float, float]) -> Array:
    """Distance between the midpoints to both neighbours, or to an end of the range."""
    between = 0.5 * (lambda_nm[1:] + lambda_nm[:-1])
    same = direction[1:] == direction[:-1]
    below = np.concatenate([[range_nm[0]], np.where(same, between, range_nm[0])])[: len(lambda_nm)]
    above = np.concatenate([np.where(same, between, range_nm[1]), [range_nm[1]]])[: len(lambda_nm)]
    return np.asarray(above - below)


class Nmm(Method):
    """From n_min to n_max ([S14] 1.5.2), with a white centre."""

    source = "[S14] 1.5.2"

    def __init__(
        self,
        field: HeightField,
        config: Config,
        *,
        white_radius: float | None = None,
        reach: Reach = FOUR_SIGMA,
    ) -> None:
        """`white_radius`: of the white circle in (u, v); None takes lambda_max over the patch's smaller side.

        Raises ConfigError for a laser line, which leaves nothing to select, and DeviceError where no device works.
        """
        if config.light.is_line:
            fault = "expected a spectrum: NMM selects wavelengths from a range, and a laser line has one"
            raise ConfigError(config.name, [("spectrum.illuminant", fault)])
        self._config, self._size_um = config, field.size_um
        first_order = 1e-3 * config.light.range_nm[1] / min(field.size_um)
        self.white_radius = first_order if white_radius is None else white_radius
        self._lookup = Lookup(field, config, None, reach)
        self.stored_bytes = self._lookup.stored_bytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        return integrated(self._spread, self._config, wi, wr, FINE_STEP_NM)

    def _spread(self, uvw: Array, nodes_nm: Array) -> Array:
        """|P|^2 (directions, L) on the grid of the colour weights, holding the power at the selected wavelengths.

        [S14] interpolates colour weights linearly between whole nanometres; spreading a value over both with the same
        shares gives the same sum.
        """
        chosen = landing(uvw[:, :2], self._size_um, self._config.light.range_nm)
        # wavelengths beyond the Nyquist limits add nothing
        power = np.nan_to_num(self._lookup.at_pairs("gaussian", uvw[chosen.direction], chosen.lambda_nm))
        light = spread(chosen.direction, chosen.lambda_nm, power * chosen.share_nm, nodes_nm, len(uvw))
        light[np.hypot(uvw[:, 0], uvw[:, 1]) < self.white_radius] = 1.0
        return light
