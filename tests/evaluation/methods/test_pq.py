"""PQ: the transform of a finite crystal of patches, its orders, and its fringes against FLSS."""

import numpy as np
import pytest
from scipy.special import jv

from pipeline.evaluation.methods.dft_terms import Coefficients
from pipeline.evaluation.methods.flss import Flss, Pq
from pipeline.evaluation.methods.method import Monochromatic
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e
from pipeline.surface.heightfield import HeightField
from tests.evaluation.methods.surfaces import ELAPHE, config, made

NM = np.array([550.0])


@pytest.mark.parametrize("patches", [(1, 1), (2, 2), (3, 2)])
def test_it_is_the_sum_over_all_samples_of_the_patches(patches: tuple[int, int]) -> None:
    """|mean exp(i k w h) exp(2 pi i f.x)| over n x m copies laid side by side: no series, no DFT, no window.

    A sinc cut after 400 coefficients leaves 1 / 400 pi of amplitude. The samples' number is odd, so that no
    coefficient of the DFT represents two frequencies.
    """
    rng = np.random.default_rng(4)
    field = HeightField(rng.uniform(-0.04, 0.04, (45, 51)), (0.11, 0.13))
    uvw = np.stack([rng.uniform(-0.5, 0.5, 60), rng.uniform(-0.5, 0.5, 60), rng.uniform(-2.0, -1.0, 60)], axis=-1)
    tiled = np.tile(field.centred().heights_um, patches[::-1])
    x, y = (np.arange(n) * pitch for n, pitch in zip(tiled.shape[::-1], field.pitch_um, strict=True))
    expected = [abs(np.mean(np.exp(2j * np.pi / 0.55 * (w * tiled + u * x + v * y[:, None])))) for u, v, w in uvw]
    of = config({"kind": "mirror"}, sigma=3.0)
    found = Pq(field, of, patches=patches, reach=Coefficients(400)).power(uvw, NM)[:, 0]
    np.testing.assert_allclose(np.sqrt(found), expected, atol=1 / (400 * np.pi))
    assert max(expected) > 0.1


def test_a_mirror_in_its_own_reflection_is_one_ru() -> None:
    of = config({"kind": "mirror", "size_um": 20.0, "pitch_um": 0.1})
    straight = np.array([[0.0, 0.0, 1.0]])
    assert Pq(made(of), of).xyz(straight, straight)[0, 1] == pytest.approx(1.0, abs=1e-6)


def test_a_mirror_shows_a_box_where_the_window_was_a_bell() -> None:
    """sinc^2 of the whole width of the patches: its first side lobe is 0.047, where a Gaussian has none."""
    of = config({"kind": "mirror", "size_um": 26.0, "pitch_um": 0.1})
    field = made(of)
    u = np.linspace(-0.05, 0.05, 101)
    uvw = np.stack([u, np.zeros_like(u), np.full_like(u, -2.0)], axis=-1)
    expected = np.sinc(2 * field.size_um[0] * u / 0.55) ** 2
    np.testing.assert_allclose(Pq(field, of, patches=(2, 2)).power(uvw, NM)[:, 0], expected, atol=1e-6)


@pytest.mark.parametrize("theta_deg", [0.0, 40.0])
def test_orders_stand_where_the_grating_equation_says(theta_deg: float) -> None:
    """sin(ti) + sin(tr) = -m lambda / period, and there a sinusoid's |P|^2 is J_m(k w a)^2."""
    of = config({"kind": "sinusoid", "period_um": 2.6, "amplitude_um": 0.12, "size_um": 26.0, "pitch_um": 0.1})
    field = made(of)
    sine = np.linspace(-0.98, 0.98, 3921)
    wr = geometry.direction(np.arcsin(sine), 0.0)
    wi = np.broadcast_to(geometry.direction(np.radians(theta_deg), 0.0), wr.shape)
    uvw = geometry.uvw(wi, wr)
    method = Pq(field, of)
    power = method.power(uvw, NM)[:, 0]
    peaks = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] > power[2:]) & (power[1:-1] > 0.01)) + 1
    orders = uvw[peaks, 0] * 2.6 / 0.55
    # side lobes of the box lie at one and a half coefficients, a twentieth of an order, and 0.05 of its height
    main = [peak for peak in peaks if power[peak] > 0.2 * power[np.abs(sine - sine[peak]) < 0.03].max()]
    found = uvw[main, 0] * 2.6 / 0.55
    np.testing.assert_allclose(found, np.round(found), atol=0.01)
    assert len(np.unique(np.round(orders))) >= 4
    exact_u = np.round(found) * 0.55 / 2.6
    expected = jv(np.round(found), 2 * np.pi / 0.55 * uvw[main, 2] * 0.12) ** 2
    at_orders = np.stack([exact_u, np.zeros_like(exact_u), uvw[main, 2]], axis=-1)
    np.testing.assert_allclose(method.power(at_orders, NM)[:, 0], expected, atol=1e-5)


def test_between_two_patches_it_is_dark_at_every_half_coefficient(elaphe: HeightField) -> None:
    """pq of two patches is |cos(pi f X)|: fringes as fine as the patch is wide, and none in FLSS."""
    size = elaphe.size_um[0]
    f = np.arange(20, 60) / size
    v = np.full_like(f, 0.1)

    def power(method: Monochromatic, offset: float) -> np.ndarray:
        uvw = np.stack([0.55 * (f + offset / size), v, np.full_like(f, -1.8)], axis=-1)
        return method.power(uvw, NM)[:, 0]

    fringed, plain = Pq(elaphe, ELAPHE), Flss(elaphe, ELAPHE)
    assert power(fringed, 0.5).max() < 1e-9 * power(fringed, 0.0).min()
    assert np.median(power(plain, 0.5)) > 0.2 * np.median(power(plain, 0.0))


def test_fringes_are_coloured(elaphe: HeightField) -> None:
    """Across the fringes, an eighth of one a step, chromaticity swings where FLSS's drifts."""
    v = np.arange(0.02, 0.12, 0.55 / elaphe.size_um[1] / 8)
    wr = np.stack([np.full_like(v, 0.25), v, np.sqrt(1 - 0.25**2 - v**2)], axis=-1)
    wi = np.broadcast_to([0.0, 0.0, 1.0], wr.shape)

    def swing(xyz: np.ndarray) -> float:
        chromaticity = xyz[:, :2] / xyz.sum(axis=1, keepdims=True)
        return float(np.sqrt(np.mean(np.diff(chromaticity, axis=0) ** 2)))

    assert swing(Pq(elaphe, ELAPHE).xyz(wi, wr)) > 2 * swing(Flss(elaphe, ELAPHE).xyz(wi, wr))


def test_elaphe_looks_different(elaphe: HeightField) -> None:
    """More than a just noticeable difference, at an exposure that makes the two equally bright."""
    sine = np.linspace(-0.9, 0.9, 41)
    x, y = (axis.ravel() for axis in np.meshgrid(sine, sine))
    inside = np.hypot(x, y) < 0.95
    wr = np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))], axis=-1)[inside]
    wi = np.broadcast_to([0.0, 0.0, 1.0], wr.shape)
    fringed, plain = Pq(elaphe, ELAPHE).xyz(wi, wr), Flss(elaphe, ELAPHE).xyz(wi, wr)
    fringed *= np.median(plain[:, 1]) / np.median(fringed[:, 1])
    assert delta_e(fringed, plain, 7500.0).mean() > 2.3


def test_as_many_patches_as_coherent_light_spans() -> None:
    """ceil(4 sigma / X), at least two: a blaze of one period fits 26 times into 65 um."""
    single = config({"kind": "blazed", "period_um": 2.5, "size_um": 2.5, "pitch_um": 0.05}, sigma=16.25)
    field = made(single)
    u = np.linspace(0.0, 0.5, 97)
    uvw = np.stack([u, np.zeros_like(u), np.full_like(u, -1.9)], axis=-1)
    by_default = Pq(field, single).power(uvw, NM)
    np.testing.assert_array_equal(by_default, Pq(field, single, patches=(26, 26)).power(uvw, NM))
    assert np.abs(by_default - Pq(field, single, patches=(13, 26)).power(uvw, NM)).max() > 1e-2


def test_beyond_the_band_nothing_is_known() -> None:
    of = config({"kind": "gaussian", "size_um": 12.0, "pitch_um": 0.3}, sigma=2.0)
    uvw = np.array([[0.90, 0.0, -1.0], [0.93, 0.0, -1.0], [0.0, -0.93, -1.0]])
    method = Pq(made(of), of)
    np.testing.assert_array_equal(np.isfinite(method.power(uvw, NM)[:, 0]), [True, False, False])
    wi, wr = geometry.direction(np.radians([70.0]), 0.0), geometry.direction(np.radians([70.0]), 0.1)
    np.testing.assert_array_equal(method.xyz(wi, wr), 0.0)
