"""[D14] fig. 17, [S14] fig. 2.5 and 2.6: the step of the spectral integral, on Elaphe and on the blazed grating."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import EXPOSURES_RU, NOTICEABLE, SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Page, PageText, Picture
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import BLUE, GREEN, VERMILION
from pipeline.optics.colour import delta_e
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_STEPS_NM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_SHOWN_NM = (1.0, 5.0, 10.0, 20.0, 50.0)
_FINEST_NM = 0.5
_ARTEFACTS_FROM_NM = 10.0


@dataclass(frozen=True)
class _Steps:
    """XYZ in RU (views, 3) by step, and which views are lit in the finest of them at 1500 RU."""

    surface: BenchSurface
    xyz: dict[float, Array]
    lit: np.ndarray

    def error(self, step_nm: float, exposure_ru: float) -> Array:
        """CIELAB difference (views,) from the finest step."""
        return delta_e(self.xyz[step_nm], self.xyz[_FINEST_NM], exposure_ru)

    def mean(self, step_nm: float, exposure_ru: float) -> float:
        return float(np.mean(self.error(step_nm, exposure_ru)))

    def lit_mean(self, step_nm: float) -> float:
        """Mean difference of the lit views at 7500 RU."""
        return float(np.mean(self.error(step_nm, STRICT_RU)[self.lit]))

    def tail(self, step_nm: float) -> float:
        """99th percentile of the difference at 7500 RU."""
        return float(np.percentile(self.error(step_nm, STRICT_RU), 99))

    def row(self, step_nm: float) -> tuple[float, ...]:
        """Return a step's numbers for the page's table."""
        means = (self.mean(step_nm, ru) for ru in EXPOSURES_RU)
        return step_nm, *means, self.lit_mean(step_nm), self.tail(step_nm)


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: error by step at the exposures of maps and of table 2."""
    views = maps.views_of(bench)
    found = [_measure(surface, views, progress) for surface in (bench.elaphe, bench.blazed)]
    known = {"finest": _FINEST_NM, "coarse": _ARTEFACTS_FROM_NM, "reference": STEP_NM}
    text = PageText("wavelength_step", shown=SHOWN_RU, strict=STRICT_RU, **known)
    return text.page(
        checks=_checks(text, *found),
        tables=[text.table("steps", map(each.row, _STEPS_NM), id=each.surface.name) for each in found],
        pictures=_pictures(text, views, found),
    )


def _measure(surface: BenchSurface, views: Map, progress: Progress) -> _Steps:
    config, exact = surface.config, surface.reference(progress)
    wi, wr = maps.directions(views, maps.NORMAL)
    xyz = {}
    for step_nm in (_FINEST_NM, *_STEPS_NM):
        found = exact.xyz(config.light, config.material, wi, wr, step_nm, progress)
        xyz[step_nm] = found / surface.unit
    return _Steps(surface, xyz, maps.lit_views(xyz[_FINEST_NM]))


def _checks(text: PageText, elaphe: _Steps, blazed: _Steps) -> Iterator[Check]:
    published, coarse = PUBLISHED_STEP_NM, _ARTEFACTS_FROM_NM
    worst, strict = max(elaphe.mean(published, ru) for ru in EXPOSURES_RU), elaphe.mean(coarse, STRICT_RU)
    yield text.check("elaphe.5nm", worst, bound=NOTICEABLE)
    yield text.check("elaphe.10nm", strict, bound=NOTICEABLE)
    for nm in (published, coarse):
        yield text.check("elaphe.{nm:g}nm.tail", elaphe.tail(nm), nm=nm)
    yield text.check("blazed.10nm", blazed.mean(coarse, STRICT_RU), bound=strict)
    yield text.check("blazed.10nm.lit", blazed.lit_mean(coarse), bound=elaphe.lit_mean(coarse))
    yield text.check("reference.step", max(each.mean(STEP_NM, STRICT_RU) for each in (elaphe, blazed)))


def _pictures(text: PageText, views: Map, found: list[_Steps]) -> list[Picture]:
    def note(error: float) -> str:
        return f"mean ΔE {error:.2f}" if error >= 0.005 else "mean ΔE below 0.01"

    def chart(each: _Steps) -> Chart:
        shown, strict = ([each.mean(step, ru) for step in _STEPS_NM] for ru in EXPOSURES_RU)
        series = [
            Series("map, 1500 RU", _STEPS_NM, shown, BLUE),
            Series("map, 7500 RU", _STEPS_NM, strict, VERMILION),
            Series("lit views, 7500 RU", _STEPS_NM, [each.lit_mean(step) for step in _STEPS_NM], GREEN),
        ]
        marks, level = [(PUBLISHED_STEP_NM, "[D14]")], (NOTICEABLE, "noticeable")
        return text.chart("steps", series, surface=each.surface.name, level=level, marks=marks)

    rows = [
        [maps.panel(views, each.xyz[step], f"{step:g} nm", note(each.mean(step, SHOWN_RU))) for step in _SHOWN_NM]
        for each in found
    ]
    names = [each.surface.name for each in found]
    return [
        text.picture("maps", maps.sheet(rows, "Wavelength step, normal incidence", names)),
        text.picture("curves", charts([[chart(each) for each in found]])),
    ]
