"""The steps from a height field to a polar table, for given numbers of terms and nodes."""

from dataclasses import dataclass
from functools import cached_property

from kernels.spectral_operator import RingQuadratures
from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.polar_grid import Azimuths, Rings, last_ring
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics.brdf import Radiometry
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import MIDDLE, Places
from pipeline.tables.polar import quadrature, spectral_integral
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.spectral_integral import IntegralSize, Integrand
from pipeline.tables.polar.table import PolarTable


@dataclass(frozen=True)
class PolarBake:
    """The settings of a polar bake, and its steps: stack, power spectrum E, quadratures, table.

    radiometry: light, material and coherence window of the tables.
    lambda_min_nm: shortest wavelength for which E is computed, nm.
    rho_max: largest |(u, v)| that is looked up, dimensionless.
    spacing: distance of the radii of E, in widths sigma_f of the window's transform.
    terms: number of Chebyshev terms of the stack.
    tolerance: amplitude, relative to its peak, at which the window's transform is cut.
    s_nodes: number of Chebyshev nodes of E in s = k |w|. w_terms: number of Chebyshev terms of tables in |w|.
    quadrature_error: relative error allowed in the wavelength quadrature of each ring.
    """

    radiometry: Radiometry
    lambda_min_nm: float
    rho_max: float
    spacing: float
    terms: int
    tolerance: float
    s_nodes: int
    w_terms: int
    quadrature_error: float

    @cached_property
    def radius_per_um(self) -> Array:
        """Radii of E (n_r,), 1/um, ascending from 0."""
        reach_per_um = last_ring(self.rho_max) / (1e-3 * self.lambda_min_nm)
        return power_spectrum.radii(self.sigma_um, reach_per_um, self.spacing)

    @property
    def sigma_um(self) -> float:
        """Standard deviation of the coherence window, um."""
        return self.radiometry.sigma_um

    def stack(self, field: HeightField, progress: Progress = silent, *, whole: bool = False) -> Stack:
        """Transforms the Chebyshev terms of the heights that a window in the middle sees, or of all, in float32.

        Raises AccuracyError if the samples do not resolve the window, ResourceError if the stack does not fit into
        memory, and DeviceError if no device works.
        """
        reach = float(self.radius_per_um[-1])
        return power_spectrum.chebyshev_stack(
            field, self.sigma_um, reach, self.terms, self.tolerance, progress, whole=whole
        )

    def power_spectrum(self, stack: Stack, azimuths: Azimuths, places: Places = MIDDLE) -> PolarPowerSpectrum:
        """Computes E from a stack on the given azimuths, of one window or the mean over several.

        Raises DeviceError if no device works.
        """
        return power_spectrum.build(stack, azimuths, self.radius_per_um, self.lambda_min_nm, self.s_nodes, places)

    def rules(self, rho: Array) -> RingQuadratures:
        """Chooses the wavelengths of rings at radii `rho` (n_rings,), dimensionless, for `quadrature_error`.

        Raises AccuracyError if no step is fine enough.
        """
        return quadrature.choose(self.radiometry.illumination, rho, self.sigma_um, self.quadrature_error)

    def power_spectrum_bytes(self, azimuths: int) -> int:
        """Computes the size of E on so many azimuths, bytes."""
        return power_spectrum.power_spectrum_bytes(azimuths, len(self.radius_per_um), self.s_nodes)

    def integral_size(self, rings: Rings, azimuths: int) -> IntegralSize:
        """Computes the size of the table and of the integral that makes it."""
        rho = rings.rho()
        expected = quadrature.expected(self.radiometry.light, rho, self.sigma_um)
        s_max = power_spectrum.s_max(self.lambda_min_nm)
        return spectral_integral.size(self.radius_per_um, self.s_nodes, s_max, rho, expected, self.w_terms, azimuths)

    def table(self, power: PolarPowerSpectrum, rings: Rings, rules: RingQuadratures) -> PolarTable:
        """Integrates E over the wavelengths of every ring. Raises ResourceError if that does not fit into memory."""
        return polar.build(power, rings, [self.integrand(rules)], self.w_terms)[0]

    def integrand(self, rules: RingQuadratures) -> Integrand:
        """Combines the wavelengths of the rings with the material; several lights' serve `table.build`."""
        return Integrand(rules, self.radiometry.reflectance)
