"""The factors of |P|^2: normalisation, reciprocity and the energy that a mirror reflects."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.optics import brdf, fresnel, geometry
from pipeline.optics.brdf import Radiometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import LaserLine, Light, trapezoid
from pipeline.optics.material import Material
from tests.optics.directions import directions, tilted

SIGMA_UM = 16.25
LAMBDA_NM = 550.0
LASER = Light(illuminant=LaserLine(lambda_nm=LAMBDA_NM))
NORMAL = np.array([0.0, 0.0, 1.0])
FRESNEL = ("none", "schlick", "dielectric", "conductor")
WHITE = trapezoid(Light(), 20.0)


def materials(**fixed):
    """Every combination of reflectance, shadowing and normalisation, some of them fixed."""
    choices = {"fresnel": FRESNEL, "shadowing": (False, True), "normalisation": ("relative", "absolute")}
    open_choices = {key: values for key, values in choices.items() if key not in fixed}
    return [
        Material(**dict(zip(open_choices, values, strict=True)), **fixed)
        for values in itertools.product(*open_choices.values())
    ]


@pytest.mark.parametrize("spectrum", [Light(), Light(illuminant="A"), LASER], ids=["D65", "A", "laser"])
@pytest.mark.parametrize("material", materials(normalisation="relative"), ids=str)
def test_relative_mirror_at_normal_incidence_is_1_ru(material, spectrum):
    """|P|^2 = 1 seen along the normal has Y = 1, whatever it is made of: that is 1 RU."""
    quadrature = Radiometry(spectrum, material, SIGMA_UM).integrand(5.0)
    factor = brdf.direction_factor(material, trapezoid(spectrum, 5.0), NORMAL, NORMAL)
    assert factor * quadrature.weights[:, 1].sum() == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=30)
@given(wi=directions(), wr=directions(), material=st.sampled_from(materials()))
def test_brdf_is_reciprocal(wi, wr, material):
    """The factor carries cos(ti); what is left does not change when light and view are exchanged."""
    there = brdf.direction_factor(material, WHITE, wi, wr) / wi[2]
    back = brdf.direction_factor(material, WHITE, wr, wi) / wr[2]
    assert there == pytest.approx(back, rel=1e-12)


@settings(max_examples=30)
@given(wi=directions(), wr=directions(), fresnel_model=st.sampled_from(FRESNEL))
def test_shadowing_multiplies_by_the_v_cavity(wi, wr, fresnel_model):
    """Switching shadowing on hides the V-cavity's share and nothing else."""
    lit, shadowed = (
        brdf.direction_factor(Material(fresnel=fresnel_model, shadowing=on), WHITE, wi, wr) for on in (False, True)
    )
    assert shadowed == pytest.approx(lit * geometry.v_cavity(wi, wr), rel=1e-13)


def test_relative_follows_the_papers_equation():
    """C cos(ti) = F^2 G cos(ti) / (F0^2 w^2) with Schlick's F, [D14] eq. 4, with numbers put in by hand.

    Light at 60 degrees, view along the normal: wi.wr = 1/2, w = -3/2, G = 1.5^2 / 0.5 = 4.5,
    cos^2 of the half angle 3/4.
    """
    material = Material(fresnel="schlick", ior=1.5, shadowing=False, normalisation="relative")
    f_over_f0 = (0.04 + 0.96 * (1.0 - np.sqrt(0.75)) ** 5) / 0.04
    expected = f_over_f0**2 * 4.5 * 0.5 / 1.5**2
    assert brdf.direction_factor(material, WHITE, tilted(60.0), NORMAL) == pytest.approx(expected, rel=1e-12)


def mirror_albedo(material, theta_deg):
    """Directional albedo of a flat mirror: its lobe |P|^2 = exp(-|f|^2 / sigma_f^2) over all solid angle.

    With u = lambda f, du dv = cos(tr) dw, so the cosine of the albedo's integral goes into the measure.
    """
    wi = tilted(theta_deg, 25.0)
    f = np.arange(-48, 49) / 8.0 * sigma_f(SIGMA_UM)
    u, v = np.meshgrid(1e-3 * LAMBDA_NM * f, 1e-3 * LAMBDA_NM * f)
    lateral = np.stack([-wi[0] - u, -wi[1] - v], axis=-1)
    wr = np.concatenate([lateral, np.sqrt(1.0 - np.sum(lateral**2, axis=-1, keepdims=True))], axis=-1)
    quadrature = trapezoid(LASER, 1.0)
    per_light = brdf.direction_factor(material, quadrature, np.broadcast_to(wi, wr.shape), wr) / wi[2]
    power = np.exp(-(f[:, None] ** 2 + f**2) / sigma_f(SIGMA_UM) ** 2)
    cell = (u[0, 1] - u[0, 0]) ** 2
    return np.sum(per_light * brdf.spectral_factor(material, quadrature, SIGMA_UM)[0] * power) * cell


@pytest.mark.parametrize("theta_deg", [0.0, 40.0])
def test_absolute_mirror_gives_back_all_light(theta_deg):
    """The albedo of a perfect mirror is 1; the lobe, 0.3 degrees wide, bends it by some 1e-5."""
    material = Material(fresnel="none", shadowing=False, normalisation="absolute")
    assert mirror_albedo(material, theta_deg) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("theta_deg", [0.0, 40.0])
@pytest.mark.parametrize(("model", "index"), [("dielectric", 1.5), ("conductor", None)])
def test_absolute_mirror_gives_back_its_reflectance(model, index, theta_deg):
    """The albedo of a mirror of glass or gold is the Fresnel reflectance at its angle."""
    material = Material(fresnel=model, shadowing=False, normalisation="absolute")
    if index is None:
        index = fresnel.metal_index("Au", np.array([LAMBDA_NM]))[0]
    expected = fresnel.reflectance(np.cos(np.radians(theta_deg)), index)
    assert mirror_albedo(material, theta_deg) == pytest.approx(expected, rel=1e-3)


@settings(max_examples=30)
@given(wi=directions(), wr=directions(), normalisation=st.sampled_from(["relative", "absolute"]))
def test_metal_separates_exactly_at_one_wavelength(wi, wr, normalisation):
    """With a single wavelength, direction times spectral factor is the metal's exact reflectance."""
    material = Material(fresnel="conductor", normalisation=normalisation)
    line = trapezoid(LASER, 1.0)
    split = brdf.direction_factor(material, line, wi, wr) * brdf.spectral_factor(material, line, SIGMA_UM)
    metal = brdf.metal_reflectance(material, line, geometry.cos_half(wi, wr))
    exact = brdf.geometry_factor(material, wi, wr) * metal * brdf.window_area(material, line, SIGMA_UM)
    np.testing.assert_allclose(split, exact, rtol=1e-12)


def test_metal_keeps_its_colour_at_normal_incidence():
    """The spectral factor of gold is its reflectance at every wavelength, and white light turns yellow."""
    material = Material(fresnel="conductor", normalisation="relative")
    spectrum = Light()
    gold = Radiometry(spectrum, material, SIGMA_UM).integrand(5.0)
    index = fresnel.metal_index("Au", gold.lambda_nm)
    ratio = brdf.spectral_factor(material, trapezoid(spectrum, 5.0), SIGMA_UM) / fresnel.reflectance(1.0, index)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)
    x, y, z = gold.weights.sum(axis=0) / trapezoid(spectrum, 5.0).weights.sum(axis=0)
    assert z < 0.7 < y < x


@pytest.mark.parametrize("material", materials(), ids=str)
def test_directions_broadcast(material):
    """A grid of views gives the same factors as its views one by one."""
    wr = geometry.direction(np.array([[0.1, 0.5, 1.2]]), np.array([[0.3], [2.0]]))
    wi = tilted(35.0)
    together = brdf.direction_factor(material, WHITE, np.broadcast_to(wi, wr.shape), wr)
    single = [[float(brdf.direction_factor(material, WHITE, wi, one)) for one in row] for row in wr]
    np.testing.assert_allclose(together, single, rtol=1e-13)
