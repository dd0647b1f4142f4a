"""A rough height field and its power spectrum, which tests of several folders share."""

import numpy as np

from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import Azimuths
from pipeline.surface.heightfield import HeightField

SIGMA = 2.0


def rough(ny: int = 120, nx: int = 90, height: float = 0.1, pitch: tuple[float, float] = (0.1, 0.09)) -> HeightField:
    """White noise: every frequency, no symmetry."""
    return HeightField(np.random.default_rng(3).uniform(-height, height, (ny, nx)), pitch)


def power_spectrum_of(
    field: HeightField, azimuths: Azimuths, lambda_min_nm: float = 380.0, spacing: float = power_spectrum.SPACING
) -> power_spectrum.PolarPowerSpectrum:
    """E of a field, with truncation errors far below those of the tests."""
    z = expansion.largest_phase(field.half_range_um, lambda_min_nm)
    terms, nodes = (expansion.chebyshev_order(z, tolerance) + 1 for tolerance in (1e-6, 1e-5))
    radius = power_spectrum.radii(SIGMA, 2e3 / lambda_min_nm, spacing)
    built = power_spectrum.chebyshev_stack(field, SIGMA, radius[-1], terms, 1e-6)
    return power_spectrum.build(built, azimuths, radius, lambda_min_nm, nodes)
