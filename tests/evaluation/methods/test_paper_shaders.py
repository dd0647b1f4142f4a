"""The shaders of [D14] sec. 5: against the exact reference, each other, and the grating equation."""

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.errors import AccuracyError
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.evaluation.methods.paper_shaders import PaperLookUp, PaperReference
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence, sigma_f
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import make
from pipeline.surface.recipes.parameters import Blazed, Mirror
from pipeline.surface.source import SurfaceSource
from pipeline.tables.taylor import grid

SIGMA_UM = 2.5


def config_of(**sections: object) -> Config:
    surface = SurfaceSource(recipe=Mirror(kind="mirror"))
    return Config(name="test", surface=surface, coherence=Coherence(sigma_um=SIGMA_UM), **sections)


def rough(height: float = 0.1, pitch: float = 0.09) -> HeightField:
    return HeightField(np.random.default_rng(3).uniform(-height, height, (110, 110)), (pitch, pitch))


def pairs(count: int, seed: int = 0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    theta, phi = np.arccos(rng.uniform(0.1, 1.0, (2, count))), rng.uniform(0, 2 * np.pi, (2, count))
    return geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])


@pytest.fixture(scope="module")
def reference_shader() -> PaperReference:
    return PaperReference(rough(), config_of())


def test_a_mirror_shows_its_window() -> None:
    """|P|^2 = exp(-f^2 / sigma_f^2) as far as the cut at 4 sigma_f, 1 at its peak."""
    flat = HeightField(np.full((110, 110), 2.0), (0.09, 0.09))
    u = np.linspace(-0.15, 0.15, 31)
    uvw = np.stack([u, 0.2 * u, np.full_like(u, -1.8)], axis=-1)
    found = PaperReference(flat, config_of()).power(uvw, np.array([450.0, 700.0]))
    f2 = 1.04 * (u[:, None] / np.array([0.45, 0.7])) ** 2
    np.testing.assert_allclose(found, np.exp(-f2 / sigma_f(SIGMA_UM) ** 2), atol=np.exp(-16.0))


def test_single_wavelengths_are_the_exact_ones_but_for_the_cut(reference_shader: PaperReference) -> None:
    """4 sigma_f leave 3e-4 of a neighbour's amplitude, the terms at worst 1e-3 of |P|^2; both signs of u."""
    wi, wr = pairs(60)
    uvw, nm = geometry.uvw(wi, wr), np.array([381.0, 450.0, 560.0, 779.0])
    exact = Reference(rough(), SIGMA_UM, 380.0).power(uvw, nm)
    np.testing.assert_allclose(reference_shader.power(uvw, nm), exact, rtol=3e-3, atol=1e-3 * np.mean(exact))


def test_its_colours_are_the_exact_ones_at_its_step() -> None:
    """The trapezoidal rule of 5 nm, a metal's colour inside the integral."""
    wi, wr = pairs(40)
    for material in (Material(), Material(fresnel="conductor")):
        settings = config_of(material=material)
        exact = Reference(rough(), SIGMA_UM, 380.0).xyz(settings.light, material, wi, wr, step_nm=5.0)
        found = PaperReference(rough(), settings).xyz(wi, wr)
        np.testing.assert_allclose(found, exact, rtol=2e-3)


def test_blazed_light_leaves_where_the_grating_equation_says() -> None:
    """[D14] eq. 13 at 75 degrees: sin(theta) = sin(phi) + m lambda / a, the first order of 2.5 um."""
    grating = make(Blazed(kind="blazed", size_um=(40.0, 10.0)))
    settings = config_of().model_copy(update={"coherence": Coherence(sigma_um=10.0)})
    shader = PaperReference(grating, settings)
    nm = np.array([420.0, 550.0, 690.0])
    phi = np.radians(np.linspace(30.0, 60.0, 3001))
    wr = np.stack([np.sin(phi), np.zeros_like(phi), np.cos(phi)], axis=-1)
    wi = np.broadcast_to(geometry.direction(np.radians(75.0), np.pi), wr.shape)
    peak = phi[np.argmax(shader.power(geometry.uvw(wi, wr), nm), axis=0)]
    np.testing.assert_allclose(np.sin(np.radians(75.0)) - np.sin(peak), 1e-3 * nm / 2.5, atol=3e-4)


def test_the_table_holds_the_reference_shaders_colours_at_its_nodes(reference_shader: PaperReference) -> None:
    """Two implementations: at a node there is nothing to interpolate."""
    look_up = PaperLookUp(rough(), config_of(), resolution=101)
    u = grid.nodes(101, 5.0)
    wr = np.array([[x, y, np.sqrt(1.0 - x**2 - y**2)] for x in u[[8, 30, 60, 88]] for y in u[[12, 50, 80]]])
    wi = np.broadcast_to([0.0, 0.0, 1.0], wr.shape)
    np.testing.assert_allclose(look_up.xyz(wi, wr), reference_shader.xyz(wi, wr), rtol=1e-3)
    assert look_up.stored_bytes == 4 * 101**2 * 3 * (2 * reference_shader.terms - 1)


def test_exchanging_light_and_view_changes_nothing_but_the_cosine(reference_shader: PaperReference) -> None:
    """Of the shader; the table keeps it as well, for u, v and w do not change."""
    wi, wr = pairs(30, seed=1)
    for method in (reference_shader, PaperLookUp(rough(), config_of(), resolution=51)):
        there, back = method.xyz(wi, wr) / wi[:, 2:], method.xyz(wr, wi) / wr[:, 2:]
        np.testing.assert_allclose(there, back, rtol=1e-10)


def test_beyond_the_band_nothing_is_claimed() -> None:
    """A pitch of 0.3 um knows |f| <= 1.67 / um, which 0.55 um light passes at u = 0.917."""
    shader = PaperReference(rough(pitch=0.3), config_of())
    uvw = np.array([[0.90, 0.0, -1.0], [0.93, 0.0, -1.0], [0.0, -0.93, -1.0]])
    assert np.isfinite(shader.power(uvw, np.array([550.0])))[:, 0].tolist() == [True, False, False]


def test_only_the_reference_shader_knows_single_wavelengths(reference_shader: PaperReference) -> None:
    assert isinstance(reference_shader, Monochromatic)
    assert not isinstance(PaperLookUp(rough(), config_of(), resolution=11), Monochromatic)
    assert reference_shader.stored_bytes > 1000


@pytest.mark.parametrize("maker", [PaperReference, PaperLookUp])
def test_heights_beyond_taylor_are_refused(maker: type) -> None:
    with pytest.raises(AccuracyError, match="Taylor tables of order"):
        maker(rough(height=0.8), config_of(spectrum=Light(range_nm=(500.0, 600.0))))
