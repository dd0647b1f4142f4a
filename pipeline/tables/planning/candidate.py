"""What polar tables of every grid are made of: a stack, and the nodes, terms and light that all of them share."""

from dataclasses import dataclass

from kernels.spectral_operator import RingQuadratures
from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.dft_stack import Stack
from pipeline.diffraction.polar_grid import Azimuths, Rings
from pipeline.diffraction.power_spectrum import PolarPowerSpectrum
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.tables.polar import quadrature
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.table import PolarTable


@dataclass(frozen=True)
class Ingredients:
    """Tables are those of a material that is grey.

    radius_per_um: of E (radii,). light: what tables are probed under. lambda_min_nm: the shortest wavelength of E.
    quadrature_error: relative, that each ring's wavelengths may leave.
    """

    stack: Stack
    radius_per_um: Array
    s_nodes: int
    w_terms: int
    light: Light
    lambda_min_nm: float
    quadrature_error: float

    @property
    def is_line(self) -> bool:
        return self.light.is_line

    def power_spectrum(self, azimuths: Azimuths) -> PolarPowerSpectrum:
        """E on these azimuths."""
        return power_spectrum.build(self.stack, azimuths, self.radius_per_um, self.lambda_min_nm, self.s_nodes)

    def rules(self, rho: Array) -> RingQuadratures:
        """Wavelengths of every ring."""
        light = Radiometry(self.light, Material(), self.stack.sigma_um).integrand
        return quadrature.choose(light, rho, self.stack.sigma_um, self.quadrature_error)

    def table(self, made: PolarPowerSpectrum, rings: Rings) -> PolarTable:
        """The table of E on these rings."""
        return polar.build(made, rings, self.rules(rings.rho()), self.w_terms)
