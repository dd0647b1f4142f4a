"""Pages of BRDF maps: their measures against closed forms and written-out sums, and every page made once."""

import json
from importlib import import_module

import numpy as np
import pytest

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.figures import maps, methods_sheet
from pipeline.evaluation.figures.maps import NORMAL, blazed_recipe, directions, lit_views, under_normal_light
from pipeline.evaluation.figures.page import Bench, BenchSurface
from pipeline.evaluation.figures.terms import ChebyshevSeries, TaylorSeries
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.evaluation.methods.paper_shaders import PaperLookUp
from pipeline.optics import brdf, geometry
from pipeline.optics.coherence import folded_window
from pipeline.optics.light import trapezoid
from pipeline.progress import silent
from pipeline.surface import recipes
from pipeline.tables.evaluate import Map

SIZE_UM, PITCH_UM, SIGMA_UM = 25.0, 0.1, 6.25
VIEWS = Map(61, 0.98)
PAGES = ("brdf_maps", "grids", "terms", "coherence_length", "wavelength_step", "methods_sheet", "costs")


def surface(kind: str, light: dict[str, object] | None = None, **recipe: object) -> BenchSurface:
    made = {"kind": kind, "size_um": SIZE_UM, "pitch_um": PITCH_UM, **recipe}
    config = Config.model_validate(
        {
            "material": {"normalisation": "relative"},
            "name": kind,
            "surface": {"recipe": made},
            "coherence": {"sigma_um": SIGMA_UM},
            # pages are looked at whole here, not for their tables' digits
            "accuracy": {"delta_e": 1.0},
            **({"spectrum": {"illuminant": light}} if light else {}),
        }
    )
    assert config.surface.recipe is not None
    return BenchSurface(config, recipes.make(config.surface.recipe), scan=False)


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(surface("blazed"), surface("elaphe"), surface("xenopeltis"), quick=True)


def truncated_power(of: BenchSurface, lowest_um: float, order: int, uvw: np.ndarray, lambda_um: float) -> np.ndarray:
    """|P|^2 of the Taylor series cut after `order`, heights counted from `lowest_um`, summed sample by sample."""
    field, sigma = of.field, of.config.coherence.sigma_um
    (ny, nx), (px, py) = field.shape, field.pitch_um
    total = folded_window(nx, px, sigma, 0.0).sum() * folded_window(ny, py, sigma, 0.0).sum()
    found = []
    for u, v, w in uvw:
        step = 1j * 2.0 * np.pi / lambda_um * w * (field.heights_um - lowest_um)
        term = np.ones_like(step)
        series = np.ones_like(step)
        for n in range(1, order + 1):
            term = term * step / n
            series += term
        along_y, along_x = folded_window(ny, py, sigma, v / lambda_um), folded_window(nx, px, sigma, u / lambda_um)
        found.append(np.abs(along_y @ series @ along_x / total) ** 2)
    return np.array(found)


# --- series ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 4, 9])
def test_both_taylor_series_are_the_sums_written_out(order: int) -> None:
    """Heights about mid-range, and from the lowest one up: other errors, both as samples give them."""
    skin = surface("elaphe", {"lambda_nm": 500.0}, size_um=12.5)
    centred = TaylorSeries.centred(skin, 12)
    sin_theta = np.array([0.0, 0.31, -0.47])
    wr = np.stack([sin_theta, 0.4 * sin_theta[::-1], np.zeros(3)], axis=-1)
    wr[:, 2] = np.sqrt(1.0 - np.sum(wr**2, axis=1))
    wi = np.tile([0.0, 0.0, 1.0], (3, 1))
    factor = brdf.direction_factor(skin.config.material, trapezoid(skin.config.light, 5.0), wi, wr)
    heights = skin.field.heights_um
    for series, lowest in ((centred, 0.5 * (heights.max() + heights.min())), (centred.raised(), heights.min())):
        expected = truncated_power(skin, lowest, order, geometry.uvw(wi, wr), 0.5)
        # the window's transform is cut where it has fallen to 1e-5
        np.testing.assert_allclose(series.xyz(order, wi, wr)[:, 1] / factor, expected, rtol=1e-3, atol=1e-5)


def test_all_series_end_at_the_reference(bench: Bench) -> None:
    """Heights from 0 take about twice the terms of centred ones, Chebyshev fewer; all come to the same."""
    views = Map(15, 0.98)
    wi, wr = directions(views, NORMAL)
    config = bench.elaphe.config
    exact = bench.elaphe.reference().xyz(config.light, config.material, wi, wr, 5.0)
    taylor, chebyshev = TaylorSeries.centred(bench.elaphe, 39), ChebyshevSeries(bench.elaphe, 19)
    for found in (taylor.xyz(24, wi, wr), taylor.raised().xyz(39, wi, wr), chebyshev.xyz(19, wi, wr)):
        np.testing.assert_allclose(found, exact, rtol=1e-3, atol=1e-7)
    assert np.max(np.abs(taylor.raised().xyz(19, wi, wr) - exact)) > 1e-3


# --- measures ----------------------------------------------------------------------------------------


def test_the_blaze_is_the_reference_in_closed_form(bench: Bench) -> None:
    """sinc^2(m - |w| h / lambda) under the window, against the sum over 25 samples a period."""
    recipe, config = blazed_recipe(bench), bench.blazed.config
    x = np.linspace(-0.6, 0.6, 61)
    wi, wr = under_normal_light(x)
    exact = bench.blazed.reference().xyz(config.light, config.material, wi, wr)[:, 1]
    closed = maps.blazed_luminance(config, recipe, wr)
    assert np.max(np.abs(closed - exact)) < 5e-3 * np.max(exact)


def test_orders_lie_where_the_grating_equation_has_them() -> None:
    grating = surface("sinusoid", period_um=2.5, axis="y")
    exact = Reference(grating.field, SIGMA_UM, 380.0)
    expected, found = maps.order_sines(exact, SIGMA_UM, 2.5, 600.0, (-2, -1, 1, 2))
    np.testing.assert_allclose(expected, [-0.48, -0.24, 0.24, 0.48])
    np.testing.assert_allclose(found, expected, atol=1e-3)
    # a wrong period is seen: the peak lies at the end of where it is looked for, or elsewhere
    _, wrong = maps.order_sines(exact, SIGMA_UM, 2.6, 600.0, (1, 2))
    assert np.all(np.abs(wrong - np.array([0.6, 1.2]) / 2.6) > 1e-3)


def test_sectors_and_sides() -> None:
    """An even map has the sectors' share of the ring; light below the centre has v > 0."""
    views = Map(201, 0.98)
    wr = views.views()
    horizontal, vertical = maps.sectors(np.ones(len(wr)), views, NORMAL)
    assert horizontal == pytest.approx(0.25, abs=2e-3)
    assert vertical == pytest.approx(0.25, abs=2e-3)
    # sectors are seen from the mirror direction, which tilted light moves
    lit = np.where(np.abs(wr[:, 1]) < 0.05, 1.0, 0.0)
    assert maps.sectors(lit, views, (20.0, 0.0))[0] == pytest.approx(1.0, abs=0.01)
    below = np.where(wr[:, 1] < 0.0, 3.0, 1.0)
    assert maps.below_over_above(below, views, NORMAL, (0.2, 0.5)) == pytest.approx(3.0)


def test_bands_and_their_contrast() -> None:
    """A primary band alone has none; a secondary one as bright again as the ground has 1."""
    views = Map(201, 0.98)
    y = views.views()[:, 1]
    primary = 1e-3 + np.exp(-((y / 0.02) ** 2))
    assert methods_sheet.band_contrast(primary, views) == pytest.approx(0.0, abs=1e-9)
    banded = primary + 1e-3 * np.exp(-(((y + 0.2) / 0.03) ** 2))
    assert methods_sheet.band_contrast(banded, views) == pytest.approx(1.0, abs=0.02)
    assert methods_sheet.lopsided(primary, views) < 1e-12
    assert methods_sheet.lopsided(banded, views) == pytest.approx(1e-3 / 1.001, rel=0.02)


def test_oscillation_is_that_of_a_known_ripple() -> None:
    x = np.linspace(0.3, 0.95, 1301)
    ripple = 1.0 + 0.2 * np.sin(2.0 * np.pi * x / 0.008)
    profile = methods_sheet.Profile(x, {"ripple": ripple * np.exp(-x), "plain": np.exp(-x)})
    assert methods_sheet.oscillation(profile, "ripple") == pytest.approx(0.2 / np.sqrt(2.0), rel=0.02)
    assert methods_sheet.oscillation(profile, "plain") < 1e-3


def test_black_views_are_not_lit() -> None:
    """1500 RU of 1e-9 of white is below one step of 255, of 1e-3 far above."""
    assert lit_views(np.array([[1e-9] * 3, [1e-3] * 3])).tolist() == [False, True]


# --- pages -------------------------------------------------------------------------------------------

# checks that hold at any window and size: closed forms and symmetries
ALWAYS = {
    "brdf_maps": ("blazed.luminance", "cd.tracks", "elaphe.horizontal"),
    "terms": ("modes.first", "all.chebyshev", "all.centring", "all.bound", "all.raised"),
    "coherence_length": ("line.width", "colour.purity"),
    "wavelength_step": ("reference.step",),
    "methods_sheet": (
        *("flss.blazed", "flss.elaphe", "nmm.white", "nmm.exact"),
        *("gems.even", "gems.exact", "gaussian.even", "gaussian.exact"),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_every_page_is_whole(bench: Bench, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its document is JSON, its ids are unique, its pictures PNGs; and closed forms hold on a small patch."""
    monkeypatch.setitem(METHODS, "D14 look-up", lambda field, config: PaperLookUp(field, config, resolution=51))
    page = import_module(f"pipeline.evaluation.figures.{name}").make(bench, silent)
    assert page.name == name
    assert page.pictures
    assert all(picture.png.startswith(b"\x89PNG") for picture in page.pictures)
    document = page.document()
    json.dumps(document, allow_nan=False)
    assert len(document["tables"]) == len(page.tables)
    for table in page.tables:
        assert len(set(table.headings)) == len(table.headings)
        assert all(len(texts) == len(table.columns) for texts in table.texts)
    checks = {check.id: check for check in page.checks}
    assert len(checks) == len(page.checks)
    assert {key: checks[key].verdict for key in ALWAYS.get(name, ())} == dict.fromkeys(ALWAYS.get(name, ()), "holds")
