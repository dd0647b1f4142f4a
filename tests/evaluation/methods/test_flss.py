"""FLSS: against the exact reference, against closed forms, and what its published reaches cost."""

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.methods import dft_terms
from pipeline.evaluation.methods.dft_terms import FOUR_SIGMA, FULL, THREE_BY_THREE, Coefficients, Reach
from pipeline.evaluation.methods.flss import Flss
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Monochromatic
from pipeline.optics import geometry
from pipeline.scene.pairs import random_pairs
from pipeline.surface.heightfield import HeightField
from tests.evaluation.methods.surfaces import ELAPHE, SIGMA, config, made

# one part in ten million of a mirror: four decades below what an exposure of 1000 RU shows
DARK = 1e-7


def errors(method: Flss, field: HeightField, of: Config) -> np.ndarray:
    """|XYZ - exact| over max(exact, 1e-7 of the mirror) of 400 pairs of directions, both at 5 nm."""
    wi, wr = random_pairs(None, 400, seed=5)
    reference = Reference(field, of.coherence.sigma_um, 380.0)
    exact = reference.xyz(of.light, of.material, wi, wr, step_nm=PUBLISHED_STEP_NM)
    return np.abs(method.xyz(wi, wr) - exact) / np.maximum(exact, DARK)


def test_with_full_reach_it_is_the_exact_reference(elaphe: HeightField) -> None:
    """1e-3 at the worst of 400 directions, 1e-4 in the mean, by another series, basis and precision."""
    found = errors(Flss(elaphe, ELAPHE, reach=FULL), elaphe, ELAPHE)
    assert found.max() < 1e-3
    assert found.mean() < 1e-4


def test_published_reaches_cost_more() -> None:
    """A patch of pi sigma: 4 sigma_f are two coefficients exactly, so the box that spans them holds no more."""
    of = config({"kind": "elaphe", "size_um": np.pi * SIGMA, "pitch_um": 0.1})
    field = made(of)
    of = of.model_copy(update={"coherence": of.coherence.model_copy(update={"sigma_um": field.size_um[0] / np.pi})})
    full, text, code = (
        errors(Flss(field, of, reach=r), field, of).mean() for r in (FULL, FOUR_SIGMA, THREE_BY_THREE)
    )
    assert 5 * full < text < 2e-3
    assert 20 * text < code
    assert 0.005 < code < 0.2


def test_taylor_terms_are_what_limits_it(elaphe: HeightField) -> None:
    """[S14] 2.1 sees Elaphe converge at 9 terms, which leave a few percent; from 20 on only float32 is left."""
    found = [errors(Flss(elaphe, ELAPHE, terms=n, reach=FULL), elaphe, ELAPHE).mean() for n in (9, 12, 20, 26)]
    assert found[0] > 1e-2 > 5 * found[1]
    assert found[1] > 5e-4 > 20 * found[2]
    assert found[3] == pytest.approx(found[2], rel=0.05)


def test_three_by_three_around_the_floor_jumps_at_coefficients(elaphe: HeightField) -> None:
    """Passing a coefficient of frequency exchanges a neighbour one spacing off for one two spacings off."""
    nm, size = 550.0, elaphe.size_um[0]
    order = np.arange(5, 45)
    u = 1e-3 * nm * (order[:, None] + np.array([-1e-6, 1e-6])) / size
    uvw = np.stack([u, np.full_like(u, 0.13), np.full_like(u, -1.7)], axis=-1).reshape(-1, 3)

    def jump(reach: Reach) -> float:
        below, above = Flss(elaphe, ELAPHE, reach=reach).power(uvw, np.array([nm])).reshape(-1, 2).T
        return float(np.median(np.abs(above - below) / (above + below)))

    assert jump(THREE_BY_THREE) > 0.05
    assert jump(FULL) < 1e-4


@pytest.mark.parametrize("fresnel", ["none", "schlick", "conductor"])
def test_a_mirror_in_its_own_reflection_is_one_ru(fresnel: str) -> None:
    of = config({"kind": "mirror", "size_um": 20.0, "pitch_um": 0.1}, material={"fresnel": fresnel})
    straight = np.array([[0.0, 0.0, 1.0]])
    assert Flss(made(of), of).xyz(straight, straight)[0, 1] == pytest.approx(1.0, abs=1e-6)


def test_a_mirror_shows_the_transform_of_its_window() -> None:
    """|P|^2 = exp(-f^2 / sigma_f^2): the neighbourhood's weights need no factor."""
    of = config({"kind": "mirror", "size_um": 4 * SIGMA, "pitch_um": 0.1})
    u = np.linspace(-0.03, 0.03, 31)
    uvw = np.stack([u, 0.5 * u, np.full_like(u, -2.0)], axis=-1)
    expected = np.exp(-(u**2 + (0.5 * u) ** 2) / 0.55**2 * (2 * np.pi * SIGMA) ** 2)
    found = Flss(made(of), of, reach=FULL).power(uvw, np.array([550.0]))[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_plane_rising_towards_x_reflects_towards_minus_x() -> None:
    """Normal incidence on 2 degrees: the light leaves at 4 on the other side of the normal."""
    of = config({"kind": "tilted_mirror", "tilt_x_deg": 2.0, "size_um": 10.0, "pitch_um": 0.1}, sigma=1.2)
    angles = np.radians(np.linspace(-8.0, 8.0, 161))
    wr = geometry.direction(angles, 0.0)
    uvw = geometry.uvw(np.broadcast_to([0.0, 0.0, 1.0], wr.shape), wr)
    power = Flss(made(of), of, reach=FULL).power(uvw, np.array([550.0]))[:, 0]
    assert np.degrees(angles[np.argmax(power)]) == pytest.approx(-4.0, abs=0.11)
    # beyond 8 sigma lies the seam, the rest is a mirror
    assert power.max() == pytest.approx(1.0, abs=2e-3)


def test_terms_are_stored_between_their_extremes_and_rescaled(elaphe: HeightField) -> None:
    """Eq. 1.1 and back: D_n = mean(i^n t^n exp(+2 pi i f.x)) to half a unit of float32 times the extent."""
    built = dft_terms.transform(elaphe, 6, (7, 4))
    assert built.normalised.shape == (9, 15, 2, 6)
    assert built.normalised.min() >= 0.0
    assert built.normalised.max() <= 1.0
    x, y = elaphe.coordinates_um()
    t = elaphe.centred().heights_um / elaphe.half_range_um
    restored = built.least + built.span * built.normalised.astype(np.float64)
    for psi, phi in ((0, 0), (3, -7), (-4, 5)):
        wave = np.exp(2j * np.pi * (phi * built.spacing_per_um[0] * x + (psi * built.spacing_per_um[1] * y)[:, None]))
        for n in range(6):
            expected = np.mean((1j * t) ** n * wave)
            found = restored[psi + built.zero[0], phi + built.zero[1], :, n] @ [1.0, 1j]
            assert abs(found - expected) <= 6e-8 * (built.span[0, n] + built.span[1, n]) + 1e-15


def test_beyond_the_band_nothing_is_known_and_nothing_added() -> None:
    """A pitch of 0.3 um ends at 1.67 / um: NaN there, and XYZ of the reference, which takes it as dark."""
    of = config({"kind": "gaussian", "size_um": 12.0, "pitch_um": 0.3}, sigma=2.0)
    field = made(of)
    method = Flss(field, of, reach=FULL)
    uvw = np.array([[0.90, 0.0, -1.0], [0.93, 0.0, -1.0], [0.0, -0.93, -1.0]])
    np.testing.assert_array_equal(np.isfinite(method.power(uvw, np.array([550.0]))[:, 0]), [True, False, False])
    assert errors(method, field, of).max() < 1e-3


def test_oblong_patches_pixels_and_odd_counts() -> None:
    """Axes are not exchanged: 90 x 63 samples of 0.11 x 0.09 um, a window over several copies."""
    field = HeightField(np.random.default_rng(2).uniform(-0.1, 0.1, (63, 90)), (0.11, 0.09))
    of = config({"kind": "mirror"}, sigma=2.5)
    assert errors(Flss(field, of, reach=FULL), field, of).max() < 1e-3


def test_a_laser_line_is_one_wavelength(elaphe: HeightField) -> None:
    of = ELAPHE.model_validate({**ELAPHE.model_dump(), "spectrum": {"illuminant": {"lambda_nm": 532.0}}})
    wi, wr = random_pairs(None, 50, seed=1)
    exact = Reference(elaphe, SIGMA, 532.0).xyz(of.light, of.material, wi, wr)
    np.testing.assert_allclose(Flss(elaphe, of, reach=FULL).xyz(wi, wr), exact, rtol=1e-3, atol=1e-9)


def test_wavelengths_shorter_than_the_terms_kept_are_refused() -> None:
    of = config({"kind": "mirror", "size_um": 20.0, "pitch_um": 0.1}, spectrum={"range_nm": (600.0, 700.0)})
    grazing = np.array([[1.99, 0.0, -0.1]])
    assert Flss(made(of), of).power(grazing, np.array([600.0]))[0, 0] < 1e-9
    with pytest.raises(ValueError, match="shorter than the config's"):
        Flss(made(of), of).power(grazing, np.array([580.0]))


def test_it_is_a_method_with_a_price(elaphe: HeightField) -> None:
    assert isinstance(Flss(elaphe, ELAPHE), Monochromatic)
    nine, eighteen = (Flss(elaphe, ELAPHE, terms=n, reach=Coefficients(1)).stored_bytes for n in (9, 18))
    assert eighteen == 2 * nine
