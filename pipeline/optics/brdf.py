"""What multiplies |P|^2: Fresnel reflectance, obliquity, shadowing and the normalisation chosen.

The reflected radiance under unit irradiance is `direction_factor * sum_l spectral_factor * |P|^2 * weights`.
`direction_factor` leaves the spectral integral, `spectral_factor` stays inside. They separate exactly
unless a metal's reflectance depends on wavelength and angle together; `metal_reflectance` is that exact case.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import fresnel, geometry
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature, trapezoid
from pipeline.optics.material import Material


@dataclass(frozen=True)
class Radiometry:
    """All that turns |P|^2 into radiance: light, material and the coherence window's width.

    sigma_um: standard deviation of the coherence window, um. mean_step_nm: step of the means over wavelength that are
    taken outside the spectral integral, such as a metal's luminous mean.
    """

    light: Light
    material: Material
    sigma_um: float
    mean_step_nm: float = FINE_STEP_NM

    def illumination(self, step_nm: float) -> Quadrature:
        """Light, observer and the window's area, as one quadrature for R |P|^2, on nodes `step_nm` apart."""
        quadrature = trapezoid(self.light, step_nm)
        area = window_area(self.material, quadrature, self.sigma_um)
        return Quadrature(quadrature.lambda_nm, quadrature.weights * area[:, None])

    def integrand(self, step_nm: float) -> Quadrature:
        """Light, observer and all of the material that varies with wavelength, as one quadrature for |P|^2."""
        quadrature = trapezoid(self.light, step_nm)
        factor = spectral_factor(self.material, quadrature, self.sigma_um)
        return Quadrature(quadrature.lambda_nm, quadrature.weights * factor[:, None])

    def reflectance(self, lambda_nm: Array, cos_half: Array) -> Array:
        """R (..., L) inside the spectral integral at half angles (...,): a metal's; 1 of every other material."""
        if self.material.fresnel != "conductor":
            return grey(lambda_nm, cos_half)
        return _metal(self.material, trapezoid(self.light, FINE_STEP_NM), lambda_nm, cos_half)

    def direction_factor(self, wi: Array, wr: Array) -> Array:
        """C cos(ti) (...,) for directions (..., 3), with means over wavelength at `mean_step_nm`."""
        return direction_factor(self.material, self._mean_light, wi, wr)

    def mirror_luminance(self, wi: Array, wr: Array) -> Array:
        """Y (...,) that |P|^2 = 1 at every wavelength would give at directions (..., 3)."""
        inside = self.integrand(self.mean_step_nm).weights[:, 1].sum()
        return self.direction_factor(wi, wr) * float(inside)

    @property
    def unit(self) -> float:
        """Y of 1 RU: what exposures are multiples of."""
        return relative_unit(self.material, self._mean_light, self.sigma_um)

    @property
    def _mean_light(self) -> Quadrature:
        return trapezoid(self.light, self.mean_step_nm)


def direction_factor(material: Material, quadrature: Quadrature, wi: Array, wr: Array) -> Array:
    """C cos(ti) (...,) for directions (..., 3).

    relative: C = F^2 G / (F0^2 w^2), [D14] eq. 4. absolute: C = R G / w^2, [D14] eq. 2 with the area of the
    window carried by `spectral_factor`. Schlick's F is squared as the paper prints it; the other
    models give the reflectance R = |r|^2 itself. A metal enters by its luminous mean.
    """
    cos_half = geometry.cos_half(wi, wr)
    reflected = _reflectance(material, quadrature, cos_half)
    relative = material.normalisation == "relative"
    # of a metal the spectral factor carries the reflectance at normal incidence, so only the ratio is left
    if relative or material.fresnel == "conductor":
        reflected = reflected / _reflectance(material, quadrature, np.array(1.0))
    if relative and material.fresnel == "schlick":
        reflected = reflected**2
    return reflected * geometry_factor(material, wi, wr)


def geometry_factor(material: Material, wi: Array, wr: Array) -> Array:
    """G cos(ti) / w^2 and, where asked for, the V-cavity's shadowing: all that holds for any reflectance."""
    w = geometry.uvw(wi, wr)[..., 2]
    factor = geometry.obliquity(wi, wr) * wi[..., 2] / w**2
    return factor * geometry.v_cavity(wi, wr) if material.shadowing else factor


def grey(lambda_nm: Array, cos_half: Array) -> Array:
    """1 (..., L): nothing of R varies with wavelength, so all of it stays outside the spectral integral."""
    return np.broadcast_to(1.0, (*np.shape(cos_half), len(lambda_nm)))


def spectral_factor(material: Material, quadrature: Quadrature, sigma_um: float) -> Array:
    """What varies with wavelength inside the integral, (L,): 4 pi sigma^2 / l^2 and the metal's colour."""
    factor = np.ones_like(quadrature.lambda_nm)
    if material.fresnel == "conductor":
        factor = metal_reflectance(material, quadrature, np.array(1.0))
    return factor * window_area(material, quadrature, sigma_um)


def window_area(material: Material, quadrature: Quadrature, sigma_um: float) -> Array:
    """(L,): 4 pi sigma^2 / l^2, 1/sr, for `absolute`, which gives a perfect mirror albedo 1; else 1."""
    if material.normalisation == "relative":
        return np.ones_like(quadrature.lambda_nm)
    return 4.0 * pi * (sigma_um / (1e-3 * quadrature.lambda_nm)) ** 2


def relative_unit(material: Material, quadrature: Quadrature, sigma_um: float) -> float:
    """Y of 1 RU: a perfect mirror at normal incidence. 1 for `relative`; for `absolute` its peak BRDF in 1/sr."""
    return float(window_area(material, quadrature, sigma_um) @ quadrature.weights[:, 1])


def metal_reflectance(material: Material, quadrature: Quadrature, cos_half: Array) -> Array:
    """R_l(half angle) (..., L) of the metal; `relative` divides by its luminous mean at normal incidence."""
    return _metal(material, quadrature, quadrature.lambda_nm, cos_half)


def _metal(material: Material, light: Quadrature, lambda_nm: Array, cos_half: Array) -> Array:
    """R (..., L) of the metal at wavelengths; `relative` divides by its luminous mean under `light`."""
    values = fresnel.reflectance(np.asarray(cos_half)[..., None], fresnel.metal_index(material.metal, lambda_nm))
    if material.normalisation == "absolute":
        return values
    index = fresnel.metal_index(material.metal, light.lambda_nm)
    return np.asarray(values / _luminous_mean(fresnel.reflectance(1.0, index), light))


def _reflectance(material: Material, quadrature: Quadrature, cos_half: Array) -> Array:
    """The wavelength-free reflectance model at a half angle."""
    if material.fresnel == "none":
        return np.ones_like(cos_half)
    if material.fresnel == "schlick":
        return fresnel.schlick(cos_half, material.ior)
    if material.fresnel == "dielectric":
        return fresnel.reflectance(cos_half, material.ior)
    index = fresnel.metal_index(material.metal, quadrature.lambda_nm)
    return _luminous_mean(fresnel.reflectance(cos_half[..., None], index), quadrature)


def _luminous_mean(values: Array, quadrature: Quadrature) -> Array:
    """Mean over wavelength (..., L) -> (...,) as the eye's Y weighs it under the illuminant."""
    return np.asarray(values @ quadrature.weights[:, 1])
