"""The diffraction shader of GPU Gems ch. 8 ([G04]): a grating of one spacing, a rainbow of three bumps, a highlight.

It has no radiometry. Its colours, taken as linear sRGB with the highlight's peak at white, are those of a display
at the exposure that the config renders with; under 1 RU they are that much darker.
"""

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.method import Method
from pipeline.optics.colour import SRGB_TO_XYZ
from pipeline.surface.heightfield import HeightField
from pipeline.surface.periods import dominant_periods

# [G04]'s text has eight orders, its listing's loop n = 1 .. 7
PUBLISHED_ORDERS = 8
# [G04] C: the width of the bumps; they peak at these y = 2 lambda - 1, lambda in um from 0.5 to 1
_SHARPNESS = 4.0
_PEAKS = np.array([0.75, 0.5, 0.25])  # red, green, blue
# 1/um; [G04] leaves it to the user. Of a spacing of 1 um the highlight falls to 1/e within 11 degrees of view
DEFAULT_ROUGHNESS = 10.0


class Gems(Method):
    """sum_n rainbow(d T.H / n) + highlight exp(-(r d T.H / N.H)^2), H = wi + wr, not normalised."""

    source = "[G04] ch. 8"
    # spacing, direction, roughness, exposure and the highlight's colour: nothing is tabulated
    stored_bytes = 7 * np.dtype(float).itemsize

    def __init__(
        self,
        field: HeightField,
        config: Config,
        spacing_um: float | None = None,
        direction_deg: float = 0.0,
        orders: int = PUBLISHED_ORDERS,
        roughness: float = DEFAULT_ROUGHNESS,
    ) -> None:
        """The spacing is the surface's strongest period unless given; bands follow each other along `direction_deg`.

        direction_deg: from +x. roughness: r. Raises ConfigError where the surface has no period.
        """
        if spacing_um is None:
            found = dominant_periods(field, 2e3 / config.light.lambda_min_nm, 1)
            if not found:
                raise ConfigError(config.name, [("spacing_um", "the surface has no period: give one")])
            spacing_um = found[0].period_um
        turn = np.radians(direction_deg)
        self._tangent = np.array([np.cos(turn), np.sin(turn), 0.0])
        self.spacing_um, self._orders, self._roughness = spacing_um, orders, roughness
        self._unit = config.radiometry.unit / config.render.exposure_ru

    def xyz(self, wi: Array, wr: Array) -> Array:
        return np.asarray(self._unit * self.rgb(wi, wr) @ SRGB_TO_XYZ.T)

    def rgb(self, wi: Array, wr: Array) -> Array:
        """The shader's own colour (directions, 3), linear, not clipped."""
        half = wi + wr
        u = half @ self._tangent * self.spacing_um
        error = self._roughness * u / half[:, 2]
        return np.asarray(self._diffracted(np.abs(u)) + np.exp(-(error**2))[:, None])

    def _diffracted(self, u: Array) -> Array:
        """The rainbow's colours of the wavelengths u / n, in um, that all bands reflect in phase."""
        y = 2.0 * u[:, None] / np.arange(1, self._orders + 1) - 1.0
        offset = _SHARPNESS * (y[..., None] - _PEAKS)
        return np.asarray(np.maximum(1.0 - offset**2, 0.0).sum(axis=1))
