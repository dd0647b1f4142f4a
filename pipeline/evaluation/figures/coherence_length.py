"""[D14] fig. 16, [S14] fig. 2.10: the coherence length, on the blazed grating."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import STEP_NM, Reference
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.page import Bench, BenchSurface, Page, PageText, Picture
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.plots.charts import Series, charts
from pipeline.evaluation.plots.palette import BLUE, VERMILION
from pipeline.optics import geometry
from pipeline.optics.coherence import sigma_f
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed
from pipeline.tables.evaluate import Map

# 16.25 um is [D14]'s; the others hold from four periods of 2.5 um in their 4 sigma to fifty-two
_SIGMAS_UM = (2.5, 5.0, 10.0, 16.25, 32.5)
_WINDOW_SIGMAS = 4.0
# of a grating a few rows say all: it is the same along its lines, and the patch repeats
_ROWS = 8
_LINE_NM = 550.0
_LINE_SAMPLES, _LINE_WIDTHS = 401, 4.0
# the part of the first order that the second does not overlap and the eye sees well
_FIRST_ORDER_NM = (450.0, 680.0)
_AXIS_SAMPLES = 116


@dataclass(frozen=True)
class _Window:
    """The grating under one window.

    width_per_um: standard deviation in f of the line |P|^2 of the first order at 550 nm. expected_per_um: its closed
    form. purity: mean excitation purity of the first order's colours. xyz: the map in RU (views, 3).
    """

    sigma_um: float
    width_per_um: float
    expected_per_um: float
    purity: float
    xyz: Array

    def row(self, period_um: float) -> tuple[float, ...]:
        """Return its numbers for the page's table."""
        mixed_nm = self.width_per_um * _LINE_NM * period_um
        periods = _WINDOW_SIGMAS * self.sigma_um / period_um
        return self.sigma_um, periods, self.expected_per_um, self.width_per_um, mixed_nm, self.purity


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: the first order's line and colours for windows from 4 periods to 52."""
    views, recipe = maps.views_of(bench), maps.blazed_recipe(bench)
    found = [_measure(bench.blazed, recipe, sigma_um, views, progress) for sigma_um in _SIGMAS_UM]
    text = PageText("coherence_length", line_nm=_LINE_NM)
    off = max(abs(each.width_per_um / each.expected_per_um - 1.0) for each in found)
    growth = np.diff([each.purity for each in found])
    return text.page(
        checks=[text.check("line.width", off), text.check("colour.purity", growth.min())],
        tables=[text.table("windows", [each.row(recipe.period_um) for each in found])],
        pictures=_pictures(text, views, found),
    )


def _measure(surface: BenchSurface, recipe: Blazed, sigma_um: float, views: Map, progress: Progress) -> _Window:
    config = surface.config
    rows = HeightField(surface.field.heights_um[:_ROWS], surface.field.pitch_um)
    exact = Reference(rows, sigma_um, config.light.lambda_min_nm, progress)
    expected = sigma_f(sigma_um) / sqrt(2.0)
    wi, wr = maps.directions(views, maps.NORMAL)
    xyz = exact.xyz(config.light, config.material, wi, wr, _map_step_nm(sigma_um), progress)
    width, purity = _line_width(exact, recipe.period_um, expected), _purity(exact, config, recipe.period_um)
    return _Window(sigma_um, width, expected, purity, xyz / surface.unit)


def _map_step_nm(sigma_um: float) -> float:
    """Half the width of a line at the rim, lambda^2 sigma_f, or the paper's step: wide lines need few wavelengths."""
    return max(STEP_NM, min(PUBLISHED_STEP_NM, 0.5e-3 * _LINE_NM**2 * sigma_f(sigma_um)))


def _line_width(exact: Reference, period_um: float, expected_per_um: float) -> float:
    """Standard deviation in f, 1/um, of |P|^2 about the blazed first order at 550 nm."""
    f = 1.0 / period_um + np.linspace(-1.0, 1.0, _LINE_SAMPLES) * _LINE_WIDTHS * expected_per_um
    uvw = geometry.uvw(*maps.under_normal_light(-1e-3 * _LINE_NM * f))
    power = exact.power(uvw, np.array([_LINE_NM]))[:, 0]
    middle = np.average(f, weights=power)
    return float(np.sqrt(np.average((f - middle) ** 2, weights=power)))


def _purity(exact: Reference, config: Config, period_um: float) -> float:
    """Mean excitation purity, 0 of white to 1 of a single wavelength, of the colours of the blazed first order."""
    import colour

    u = 1e-3 * np.linspace(*_FIRST_ORDER_NM, _AXIS_SAMPLES) / period_um
    xyz = exact.xyz(config.light, config.material, *maps.under_normal_light(-u))
    white = colour.XYZ_to_xy(trapezoid(config.light, STEP_NM).weights.sum(axis=0))
    return float(np.mean(colour.excitation_purity(colour.XYZ_to_xy(xyz), white)))


def _pictures(text: PageText, views: Map, found: Sequence[_Window]) -> list[Picture]:
    panels = [
        maps.panel(views, each.xyz, f"σ = {each.sigma_um:g} µm", f"colour purity {each.purity:.2f}") for each in found
    ]
    sigmas = [each.sigma_um for each in found]
    widths = [
        Series("σ_f / √2", sigmas, [each.expected_per_um for each in found], VERMILION, "-"),
        Series("measured", sigmas, [each.width_per_um for each in found], BLUE, "o"),
    ]
    purities = [Series("measured", sigmas, [each.purity for each in found], BLUE)]
    return [
        text.picture("maps", maps.sheet([panels], "Blazed grating by coherence length, normal incidence")),
        text.picture("curves", charts([[text.chart("width", widths), text.chart("purity", purities)]])),
    ]
