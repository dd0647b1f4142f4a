"""The factors of |P|^2 in a BRDF: Fresnel reflectance, obliquity, shadowing and normalisation.

The reflected radiance under unit irradiance is `direction_factor * sum_l spectral_factor * |P|^2 * weights`, with
`spectral_factor` inside the spectral integral and `direction_factor` outside. The separation is exact, except that a
metal's reflectance depends on wavelength and angle together: `metal_reflectance` is that exact case.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from pipeline.arrays import Array
from pipeline.optics import fresnel, geometry
from pipeline.optics.light import FINE_STEP_NM, Light, Quadrature, trapezoid
from pipeline.optics.material import Material

_NORMAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Radiometry:
    """The quantities that turn |P|^2 into radiance: light, material and the width of the coherence window.

    sigma_um: standard deviation of the coherence window, um.
    mean_step_nm: wavelength step, nm, of means taken outside the spectral integral, such as a metal's luminous mean.
    """

    light: Light
    material: Material
    sigma_um: float
    mean_step_nm: float = FINE_STEP_NM

    def illumination(self, step_nm: float) -> Quadrature:
        """Combines light, observer and the window's area to a quadrature for R |P|^2, in steps of `step_nm`."""
        quadrature = trapezoid(self.light, step_nm)
        area = window_area(self.material, quadrature, self.sigma_um)
        return Quadrature(quadrature.lambda_nm, quadrature.weights * area[:, None])

    def integrand(self, step_nm: float) -> Quadrature:
        """Combines light, observer and the material's spectral factor to a quadrature for |P|^2, with step `step_nm`.

        A metal enters by its reflectance at normal incidence.
        """
        quadrature = trapezoid(self.light, step_nm)
        factor = spectral_factor(self.material, quadrature, self.sigma_um)
        return Quadrature(quadrature.lambda_nm, quadrature.weights * factor[:, None])

    def reflectance(self, lambda_nm: Array, cos_half: Array) -> Array:
        """Computes the reflectance that belongs inside the spectral integral: a metal's, and 1 for other materials.

        lambda_nm: (L,), nm. cos_half: cosine of the half angle (...,).
        Returns R (..., L).
        """
        if self.material.fresnel != "conductor":
            return grey(lambda_nm, cos_half)
        return _metal(self.material, trapezoid(self.light, FINE_STEP_NM), lambda_nm, cos_half)

    def direction_factor(self, wi: Array, wr: Array) -> Array:
        """Computes C cos(ti) (...,) for unit vectors wi, wr (..., 3); see the function of this name."""
        return direction_factor(self.material, self._mean_light, wi, wr)

    def mirror_luminance(self, wi: Array, wr: Array) -> Array:
        """Computes Y (...,) for |P|^2 = 1 at every wavelength and unit vectors wi, wr (..., 3)."""
        inside = self.integrand(self.mean_step_nm).weights[:, 1].sum()
        return self.direction_factor(wi, wr) * float(inside)

    @property
    def unit(self) -> float:
        """Y of 1 RU, the unit of exposures: of a flat sample of the material that mirrors light along its normal.

        It is 1 for `relative`, and the peak of the flat sample's BRDF, 1/sr, for `absolute`.
        """
        return float(self.mirror_luminance(_NORMAL, _NORMAL))

    @property
    def _mean_light(self) -> Quadrature:
        return trapezoid(self.light, self.mean_step_nm)


def direction_factor(material: Material, quadrature: Quadrature, wi: Array, wr: Array) -> Array:
    """Computes C cos(ti), the factor outside the spectral integral.

    relative: C = F^2 G / (F0^2 w^2), [D14] eq. 4. absolute: C = R G / w^2, [D14] eq. 2, whose window area is part of
    `spectral_factor`. Schlick's F is squared as the paper prints it; the other models give the reflectance R = |r|^2
    itself. A metal enters by its luminous mean under `quadrature`.

    wi, wr: unit vectors (..., 3).
    Returns (...,).
    """
    cos_half = geometry.cos_half(wi, wr)
    reflected = _reflectance(material, quadrature, cos_half)
    relative = material.normalisation == "relative"
    # a metal's reflectance at normal incidence is part of the spectral factor: only the ratio remains
    if relative or material.fresnel == "conductor":
        reflected = reflected / _reflectance(material, quadrature, np.array(1.0))
    if relative and material.fresnel == "schlick":
        reflected = reflected**2
    return reflected * geometry_factor(material, wi, wr)


def geometry_factor(material: Material, wi: Array, wr: Array) -> Array:
    """Computes the part of C cos(ti) without the reflectance: G cos(ti) / w^2, times the V-cavity term.

    material: only its `shadowing` is read. wi, wr: unit vectors (..., 3).
    Returns (...,); 0 where light or view are at or below the horizon.
    """
    above = geometry.above_horizon(wi, wr)
    # straight up stands in for the pairs that reflect nothing
    wi, wr = (np.where(above[..., None], one, [0.0, 0.0, 1.0]) for one in (wi, wr))
    w = geometry.uvw(wi, wr)[..., 2]
    factor = geometry.obliquity(wi, wr) * wi[..., 2] / w**2
    if material.shadowing:
        factor = factor * geometry.v_cavity(wi, wr)
    return np.asarray(np.where(above, factor, 0.0))


def grey(lambda_nm: Array, cos_half: Array) -> Array:
    """Returns 1 (..., L) for a reflectance that does not vary with wavelength and stays outside the integral."""
    return np.broadcast_to(1.0, (*np.shape(cos_half), len(lambda_nm)))


def spectral_factor(material: Material, quadrature: Quadrature, sigma_um: float) -> Array:
    """Computes the factor (L,) inside the spectral integral: window area times a metal's R at normal incidence."""
    factor = np.ones_like(quadrature.lambda_nm)
    if material.fresnel == "conductor":
        factor = metal_reflectance(material, quadrature, np.array(1.0))
    return factor * window_area(material, quadrature, sigma_um)


def window_area(material: Material, quadrature: Quadrature, sigma_um: float) -> Array:
    """Computes 4 pi sigma^2 / l^2, (L,), 1/sr, for `absolute`, which gives a perfect mirror albedo 1; else 1."""
    if material.normalisation == "relative":
        return np.ones_like(quadrature.lambda_nm)
    return 4.0 * pi * (sigma_um / (1e-3 * quadrature.lambda_nm)) ** 2


def metal_reflectance(material: Material, quadrature: Quadrature, cos_half: Array) -> Array:
    """Computes R_l of the metal at half angles; `relative` divides by its luminous mean at normal incidence.

    quadrature: the wavelengths (L,), and the light of the mean. cos_half: cosine of the half angle (...,).
    Returns R (..., L).
    """
    return _metal(material, quadrature, quadrature.lambda_nm, cos_half)


def _metal(material: Material, light: Quadrature, lambda_nm: Array, cos_half: Array) -> Array:
    """Computes R (..., L) of the metal; `relative` divides by its luminous mean under `light`."""
    values = fresnel.reflectance(np.asarray(cos_half)[..., None], fresnel.metal_index(material.metal, lambda_nm))
    if material.normalisation == "absolute":
        return values
    index = fresnel.metal_index(material.metal, light.lambda_nm)
    return np.asarray(values / _luminous_mean(fresnel.reflectance(1.0, index), light))


def _reflectance(material: Material, quadrature: Quadrature, cos_half: Array) -> Array:
    """Computes the reflectance (...,) outside the spectral integral; a metal's is its luminous mean."""
    if material.fresnel == "none":
        return np.ones_like(cos_half)
    if material.fresnel == "schlick":
        return fresnel.schlick(cos_half, material.ior)
    if material.fresnel == "dielectric":
        return fresnel.reflectance(cos_half, material.ior)
    index = fresnel.metal_index(material.metal, quadrature.lambda_nm)
    return _luminous_mean(fresnel.reflectance(cos_half[..., None], index), quadrature)


def _luminous_mean(values: Array, quadrature: Quadrature) -> Array:
    """Averages (..., L) over wavelength, weighted by Y under the illuminant, to (...,)."""
    return np.asarray(values @ quadrature.weights[:, 1])
