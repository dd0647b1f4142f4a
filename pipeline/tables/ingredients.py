"""What polar tables of every grid are made of: a stack, and the nodes, terms and light that all of them share."""

from dataclasses import dataclass
from functools import partial

from kernels.spectral_operator import RingQuadratures
from pipeline import spectrum
from pipeline.config import LaserLine, Material, Spectrum
from pipeline.optics import brdf
from pipeline.optics.geometry import Array
from pipeline.spectrum import PolarSpectrum
from pipeline.stack import Stack
from pipeline.tables import polar, quadrature
from pipeline.tables.polar import PolarTable
from pipeline.tables.polar_grid import Azimuths, Rings


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
    light: Spectrum
    lambda_min_nm: float
    quadrature_error: float

    @property
    def is_line(self) -> bool:
        return isinstance(self.light.illuminant, LaserLine)

    def spectrum(self, azimuths: Azimuths) -> PolarSpectrum:
        """E on these azimuths."""
        return spectrum.build(self.stack, azimuths, self.radius_per_um, self.lambda_min_nm, self.s_nodes)

    def rules(self, rho: Array) -> RingQuadratures:
        """Wavelengths of every ring."""
        light = partial(brdf.integrand, Material(), self.light, self.stack.sigma_um)
        return quadrature.choose(light, rho, self.stack.sigma_um, self.quadrature_error)

    def table(self, made: PolarSpectrum, rings: Rings) -> PolarTable:
        """The table of E on these rings."""
        return polar.build(made, rings, self.rules(rings.rho()), self.w_terms)
