"""GPU Gems' shader: its listing written out for one direction, and where its colours and its highlight lie."""

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.errors import ConfigError
from pipeline.evaluation.methods.gems import Gems
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.optics import geometry
from pipeline.optics.colour import displayed_srgb
from pipeline.optics.material import Material
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes import make
from pipeline.surface.recipes.parameters import Blazed, Mirror
from pipeline.surface.source import SurfaceSource

FLAT = HeightField(np.zeros((16, 16)), (0.1, 0.1))
SETTINGS = Config(name="test", surface=SurfaceSource(recipe=Mirror(kind="mirror")))


def views_at(u: Array) -> tuple[Array, Array]:
    """Light from the normal, views whose half vector has T.H = u along x."""
    wr = np.stack([u, np.zeros_like(u), np.sqrt(1.0 - u**2)], axis=-1)
    return np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr


def by_hand(light: Array, view: Array, spacing: float, orders: int, r: float) -> list[float]:
    """One direction, one statement after the other; tangent along x."""
    u = spacing * (light[0] + view[0])
    highlight = np.exp(-((r * u / (light[2] + view[2])) ** 2))
    colour = [highlight] * 3
    for n in range(1, orders + 1):
        y = 2.0 * abs(u) / n - 1.0
        for channel, peak in enumerate((0.75, 0.5, 0.25)):
            colour[channel] += max(1.0 - (4.0 * (y - peak)) ** 2, 0.0)
    return colour


@pytest.mark.parametrize("orders", [7, 8])
def test_colours_are_the_listings(orders: int) -> None:
    rng = np.random.default_rng(0)
    theta, phi = np.arccos(rng.uniform(0.1, 1.0, (2, 50))), rng.uniform(0, 2 * np.pi, (2, 50))
    wi, wr = geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])
    found = Gems(FLAT, SETTINGS, 3.1, orders=orders, roughness=0.8).rgb(wi, wr)
    expected = [by_hand(light, view, 3.1, orders, 0.8) for light, view in zip(wi, wr, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_each_colour_peaks_at_its_wavelength() -> None:
    """u d = lambda in first order: red at y = 0.75, 0.875 um; green at 0.75; blue at 0.625."""
    u = np.linspace(0.25, 0.6, 2001)
    rgb = Gems(FLAT, SETTINGS, 2.0, orders=1).rgb(*views_at(u))
    np.testing.assert_allclose(2.0 * u[np.argmax(rgb, axis=0)], [0.875, 0.75, 0.625], atol=1e-3)


def test_it_shows_a_blazed_grating_alike_on_both_sides() -> None:
    """[S14] 2.1: always symmetric; the surface gives nothing but its spacing."""
    grating = make(Blazed(kind="blazed", size_um=40.0))
    method = Gems(grating, SETTINGS)
    assert method.spacing_um == pytest.approx(2.5, rel=2e-3)
    u = np.linspace(0.02, 0.9, 50)
    np.testing.assert_allclose(method.xyz(*views_at(-u)), method.xyz(*views_at(u)), rtol=1e-12)


def test_a_turned_grating_shows_the_same_turned() -> None:
    wi, wr = views_at(np.linspace(-0.9, 0.9, 40))
    across = wr[:, [1, 0, 2]]
    along_x = Gems(FLAT, SETTINGS, 1.3).xyz(wi, wr)
    np.testing.assert_allclose(Gems(FLAT, SETTINGS, 1.3, direction_deg=90.0).xyz(wi, across), along_x, atol=1e-12)


@pytest.mark.parametrize("normalisation", ["relative", "absolute"])
def test_the_display_shows_the_shaders_own_colours(normalisation: str) -> None:
    """At the exposure of [render] the highlight is just white, in either normalisation."""
    settings = SETTINGS.model_copy(update={"material": Material(normalisation=normalisation)})
    wi, wr = views_at(np.array([0.0, 0.41]))
    method = Gems(FLAT, settings, 1.5)
    shown = displayed_srgb(method.xyz(wi, wr) / settings.radiometry.unit, settings.render.exposure_ru)
    np.testing.assert_allclose(shown, np.clip(method.rgb(wi, wr), 0.0, 1.0), atol=2e-4)
    np.testing.assert_allclose(shown[0], 1.0, atol=2e-4)


def test_exchanging_light_and_view_changes_nothing() -> None:
    rng = np.random.default_rng(4)
    theta, phi = np.arccos(rng.uniform(0.1, 1.0, (2, 50))), rng.uniform(0, 2 * np.pi, (2, 50))
    wi, wr = geometry.direction(theta[0], phi[0]), geometry.direction(theta[1], phi[1])
    method = Gems(FLAT, SETTINGS, 1.5)
    np.testing.assert_allclose(method.xyz(wi, wr), method.xyz(wr, wi), rtol=1e-12)


def test_it_has_no_single_wavelength_and_no_table() -> None:
    method = Gems(FLAT, SETTINGS, 1.5)
    assert not isinstance(method, Monochromatic)
    assert method.stored_bytes < 100


def test_a_surface_without_period_is_refused() -> None:
    with pytest.raises(ConfigError, match="spacing_um: the surface has no period"):
        Gems(FLAT, SETTINGS)
