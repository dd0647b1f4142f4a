"""[D14] fig. 17, [S14] fig. 2.5 and 2.6: the step of the spectral integral, on Elaphe and on the blazed grating."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM, integrate
from pipeline.evaluation.figures.exact_maps import (
    NORMAL,
    SHOWN_RU,
    STRICT_RU,
    directions,
    lit_views,
    reference,
    views_of,
)
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM
from pipeline.optics import geometry
from pipeline.optics.colour import delta_e, pixels
from pipeline.optics.light import trapezoid
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_STEPS_NM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_SHOWN_NM = (1.0, 5.0, 10.0, 20.0, 50.0)
_FINEST_NM = 0.5
_ARTEFACTS_FROM_NM = 10.0
_AT_ONCE = 2048
# one just noticeable difference ([D14] 6.3)
_NOTICEABLE = 1.0
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

    surface: Surface
    xyz: dict[float, Array]
    lit: np.ndarray

    def error(self, step_nm: float, exposure_ru: float) -> Array:
        """CIELAB difference (views,) from the finest step."""
        return delta_e(self.xyz[step_nm], self.xyz[_FINEST_NM], exposure_ru)

    def mean(self, step_nm: float, exposure_ru: float) -> float:
        return float(np.mean(self.error(step_nm, exposure_ru)))

    def lit_mean(self, step_nm: float, exposure_ru: float) -> float:
        return float(np.mean(self.error(step_nm, exposure_ru)[self.lit]))


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: error by step at the exposures of maps and of table 2."""
    views = views_of(bench)
    found = [_measure(surface, views, progress) for surface in (bench.elaphe, bench.blazed)]
    return Figure(
        name="wavelength_step",
        title="The step of the spectral integral",
        source="[D14] fig. 17, [S14] fig. 2.5 and 2.6",
        expected="Artefacts at steps of 10 nm and more; at 5 nm none can be discerned, and 1 nm gives nothing more. "
        "A blazed grating bears larger steps.",
        checks=_checks(*found),
        tables=[_table(each) for each in found],
        pictures=_pictures(views, found),
        remarks=[_GAPS, _STATED],
        numbers={
            each.surface.name: {
                f"{step:g} nm": {f"{ru:g} RU": each.mean(step, ru) for ru in (SHOWN_RU, STRICT_RU)}
                for step in _STEPS_NM
            }
            for each in found
        },
    )


def _measure(surface: Surface, views: Map, progress: Progress) -> _Steps:
    """|P|^2 once on the finest nodes; every other step's are among them."""
    config, exact = surface.config, reference(surface, progress)
    rules = {step: trapezoid(config.light, step) for step in (_FINEST_NM, *_STEPS_NM)}
    finest = rules[_FINEST_NM].lambda_nm
    among = {step: np.searchsorted(finest, rule.lambda_nm - 0.5 * _FINEST_NM) for step, rule in rules.items()}
    wi, wr = directions(views, NORMAL)
    xyz = {step: np.empty((len(wr), 3)) for step in rules}
    for first in range(0, len(wr), _AT_ONCE):
        part = slice(first, min(first + _AT_ONCE, len(wr)))
        power = exact.power(geometry.uvw(wi[part], wr[part]), finest)
        for step, rule in rules.items():
            seen = power[:, among[step]]
            xyz[step][part] = (
                integrate(seen, rule, config.material, config.coherence.sigma_um, wi[part], wr[part])
                / config.radiometry.unit
            )
        progress("wavelength steps", part.stop / len(wr))
    return _Steps(surface, xyz, lit_views(xyz[_FINEST_NM]))


def _checks(elaphe: _Steps, blazed: _Steps) -> list[Check]:
    published, coarse = PUBLISHED_STEP_NM, _ARTEFACTS_FROM_NM
    at_5, at_10 = (elaphe.mean(step, SHOWN_RU) for step in (published, coarse))
    strict_5, strict_10 = (elaphe.mean(step, STRICT_RU) for step in (published, coarse))
    rim = {step: float(np.percentile(elaphe.error(step, STRICT_RU), 99)) for step in (published, coarse)}
    finest = max(each.mean(STEP_NM, STRICT_RU) for each in (elaphe, blazed))
    return [
        Check(
            "Elaphe, 5 nm: not to be discerned, mean ΔE below 1",
            "indiscernible",
            f"{at_5:.3f} at {SHOWN_RU:g} RU, {strict_5:.3f} at {STRICT_RU:g} RU",
            max(at_5, strict_5) < _NOTICEABLE,
        ),
        Check(
            "Elaphe, 10 nm: artefacts, mean ΔE above 1 at 7500 RU",
            "artefacts",
            f"{at_10:.2f} at {SHOWN_RU:g} RU, {strict_10:.2f} at {STRICT_RU:g} RU",
            strict_10 > _NOTICEABLE,
        ),
        Check(
            "Elaphe, the worst hundredth of views at 7500 RU",
            "5 nm indiscernible, 10 nm not",
            f"5 nm: {rim[published]:.2f}, 10 nm: {rim[coarse]:.1f}",
            None,
        ),
        Check(
            "the blazed grating at 10 nm, mean ΔE at 7500 RU",
            "bears larger steps than Elaphe",
            f"over the map {blazed.mean(coarse, STRICT_RU):.2f}, Elaphe {strict_10:.2f}; over lit views "
            f"{blazed.lit_mean(coarse, STRICT_RU):.2f}, Elaphe {elaphe.lit_mean(coarse, STRICT_RU):.2f}",
            None,
        ),
        Check(
            f"the reference's own step of {STEP_NM:g} nm, mean ΔE at 7500 RU, the worse of both surfaces",
            "below 0.01",
            f"{finest:.1g}",
            finest < 1e-2,
        ),
    ]


def _table(found: _Steps) -> Table:
    rows = [
        [
            f"{step:g}",
            *(f"{found.mean(step, ru):.2g}" for ru in (SHOWN_RU, STRICT_RU)),
            f"{found.lit_mean(step, STRICT_RU):.2g}",
            f"{np.percentile(found.error(step, STRICT_RU), 99):.2g}",
        ]
        for step in _STEPS_NM
    ]
    columns = [
        "step (nm)",
        "mean ΔE, 1500 RU",
        "mean ΔE, 7500 RU",
        "of lit views, 7500 RU",
        "99th percentile, 7500 RU",
    ]
    return Table(f"{found.surface.name}: error by wavelength step, against {_FINEST_NM:g} nm", columns, rows)


def _pictures(views: Map, found: list[_Steps]) -> list[Picture]:
    from pipeline.evaluation.plots import map_plots

    rows = [
        [
            map_plots.Panel(
                pixels(views.image(each.xyz[step]), SHOWN_RU),
                f"{step:g} nm",
                _told(each.mean(step, SHOWN_RU)),
            )
            for step in _SHOWN_NM
        ]
        for each in found
    ]
    names = [each.surface.name for each in found]
    sheet = map_plots.sheet(rows, f"Wavelength step, normal incidence, {SHOWN_RU:g} RU", names)
    charts = [
        map_plots.Chart(
            each.surface.name,
            "wavelength step (nm)",
            "mean ΔE against 0.5 nm",
            [
                map_plots.Line("map, 1500 RU", _STEPS_NM, _curve(each.mean, SHOWN_RU), map_plots.COLOURS[0]),
                map_plots.Line("map, 7500 RU", _STEPS_NM, _curve(each.mean, STRICT_RU), map_plots.COLOURS[1]),
                map_plots.Line(
                    "lit views, 7500 RU", _STEPS_NM, _curve(each.lit_mean, STRICT_RU), map_plots.COLOURS[2]
                ),
            ],
            x_scale="log",
            level=(_NOTICEABLE, "noticeable"),
            marks=[(PUBLISHED_STEP_NM, "[D14]")],
        )
        for each in found
    ]
    return [
        Picture(sheet, "Maps by wavelength step."),
        Picture(map_plots.charts(charts), "Mean error of the map by wavelength step."),
    ]


def _told(error: float) -> str:
    return f"mean ΔE {error:.2f}" if error >= 0.005 else "mean ΔE below 0.01"


def _curve(mean: Callable[[float, float], float], exposure_ru: float) -> list[float]:
    return [mean(step, exposure_ru) for step in _STEPS_NM]
