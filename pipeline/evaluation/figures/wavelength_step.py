"""[D14] fig. 17, [S14] fig. 2.5 and 2.6: the step of the spectral integral, on Elaphe and on the blazed grating."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM, integrate
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import EXPOSURES_RU, NOTICEABLE, SHOWN_RU, STRICT_RU
from pipeline.evaluation.figures.page import Bench, BenchSurface, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import BLUE, GREEN, VERMILION
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_STEPS_NM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_SHOWN_NM = (1.0, 5.0, 10.0, 20.0, 50.0)
_FINEST_NM = 0.5
_ARTEFACTS_FROM_NM = 10.0
_AT_ONCE = 2048
_GAPS = (
    "A direction sees every wavelength under a line as wide as the window's transform, so steps above "
    "λ² σ_f / ρ leave gaps between the lines: about 3 nm at the rim for σ = 16.25 µm, and more the "
    "nearer the mirror direction. There the artefacts of a step begin."
)
_STATED = (
    f"Errors are against an integral of {_FINEST_NM:g} nm. Lit views are those not black in it at {SHOWN_RU:g} RU: "
    "of a blazed grating's map nearly all is black, and its mean error small for that alone."
)


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


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: error by step at the exposures of maps and of table 2."""
    views = maps.views_of(bench)
    found = [_measure(surface, views, progress) for surface in (bench.elaphe, bench.blazed)]
    return Page(
        name="wavelength_step",
        title="The step of the spectral integral",
        source="[D14] fig. 17, [S14] fig. 2.5 and 2.6",
        expected="Artefacts at steps of 10 nm and more; at 5 nm none can be discerned, and 1 nm gives nothing more. "
        "A blazed grating bears larger steps.",
        checks=_checks(*found),
        tables=[_table(each) for each in found],
        pictures=_pictures(views, found),
        remarks=[_GAPS, _STATED],
    )


def _measure(surface: BenchSurface, views: Map, progress: Progress) -> _Steps:
    """Compute |P|^2 once on the finest nodes; every other step's are among them."""
    config, exact = surface.config, surface.reference(progress)
    rules = {step: trapezoid(config.light, step) for step in (_FINEST_NM, *_STEPS_NM)}
    finest = rules[_FINEST_NM].lambda_nm
    among = {step: np.searchsorted(finest, rule.lambda_nm - 0.5 * _FINEST_NM) for step, rule in rules.items()}
    wi, wr = maps.directions(views, maps.NORMAL)
    xyz = {step: np.empty((len(wr), 3)) for step in rules}
    for first in range(0, len(wr), _AT_ONCE):
        part = slice(first, min(first + _AT_ONCE, len(wr)))
        power = exact.power(geometry.uvw(wi[part], wr[part]), finest)
        for step, rule in rules.items():
            seen = power[:, among[step]]
            found = integrate(seen, rule, config.material, surface.sigma_um, wi[part], wr[part])
            xyz[step][part] = found / surface.unit
        progress("wavelength steps", part.stop / len(wr))
    return _Steps(surface, xyz, maps.lit_views(xyz[_FINEST_NM]))


def _checks(elaphe: _Steps, blazed: _Steps) -> list[Check]:
    published, coarse = PUBLISHED_STEP_NM, _ARTEFACTS_FROM_NM
    at = f"at {STRICT_RU:g} RU"
    worst = max(elaphe.mean(published, ru) for ru in EXPOSURES_RU)
    strict = elaphe.mean(coarse, STRICT_RU)
    finest = max(each.mean(STEP_NM, STRICT_RU) for each in (elaphe, blazed))
    bears = f"blazed grating, {coarse:g} nm: mean ΔE {at}, against Elaphe's"
    return [
        Check("elaphe.5nm", "Elaphe, 5 nm: mean ΔE, the worse of both exposures", worst, "<", NOTICEABLE),
        Check("elaphe.10nm", f"Elaphe, 10 nm: mean ΔE {at}", strict, ">", NOTICEABLE),
        *(
            Check(f"elaphe.{nm:g}nm.tail", f"Elaphe, {nm:g} nm: 99th percentile of ΔE {at}", elaphe.tail(nm))
            for nm in (published, coarse)
        ),
        Check("blazed.10nm", f"{bears}, over the map", blazed.mean(coarse, STRICT_RU), "=", strict),
        Check("blazed.10nm.lit", f"{bears}, over lit views", blazed.lit_mean(coarse), "=", elaphe.lit_mean(coarse)),
        Check(
            "reference.step",
            f"the reference's own step of {STEP_NM:g} nm: mean ΔE {at}, the worse of both surfaces",
            finest,
            "<",
            1e-2,
        ),
    ]


def _table(found: _Steps) -> PageTable:
    return PageTable(
        found.surface.name,
        f"{found.surface.name}: error by wavelength step, against {_FINEST_NM:g} nm",
        [
            Column("step (nm)", "{:g}"),
            *numbers(
                "{:.2g}", *maps.ERROR_COLUMNS, f"of lit views, {STRICT_RU:g} RU", f"99th percentile, {STRICT_RU:g} RU"
            ),
        ],
        [
            (step, *(found.mean(step, ru) for ru in EXPOSURES_RU), found.lit_mean(step), found.tail(step))
            for step in _STEPS_NM
        ],
    )


def _pictures(views: Map, found: list[_Steps]) -> list[Picture]:
    def note(error: float) -> str:
        return f"mean ΔE {error:.2f}" if error >= 0.005 else "mean ΔE below 0.01"

    rows = [
        [maps.panel(views, each.xyz[step], f"{step:g} nm", note(each.mean(step, SHOWN_RU))) for step in _SHOWN_NM]
        for each in found
    ]
    drawn = [
        Chart(
            each.surface.name,
            "wavelength step (nm)",
            f"mean ΔE against {_FINEST_NM:g} nm",
            [
                Series("map, 1500 RU", _STEPS_NM, [each.mean(step, SHOWN_RU) for step in _STEPS_NM], BLUE),
                Series("map, 7500 RU", _STEPS_NM, [each.mean(step, STRICT_RU) for step in _STEPS_NM], VERMILION),
                Series("lit views, 7500 RU", _STEPS_NM, [each.lit_mean(step) for step in _STEPS_NM], GREEN),
            ],
            x_scale="log",
            level=(NOTICEABLE, "noticeable"),
            marks=[(PUBLISHED_STEP_NM, "[D14]")],
        )
        for each in found
    ]
    names = [each.surface.name for each in found]
    return [
        Picture(maps.sheet(rows, "Wavelength step, normal incidence", names), "Maps by wavelength step."),
        Picture(charts([drawn]), "Mean error of the map by wavelength step."),
    ]
