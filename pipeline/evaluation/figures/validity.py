"""The domain of the scalar model: first orders of gratings against a rigorous coupled-wave solver."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from pipeline.accuracy import scalar_domain
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import coupled_wave
from pipeline.evaluation.figures.page import Bench, Page, PageTable, PageText, Picture, numbers
from pipeline.evaluation.figures.scalar_errors import (
    DIELECTRIC,
    INDICES,
    METAL,
    SHAPES,
    GratingCase,
    Sweep,
    scalar,
    sweep,
)
from pipeline.evaluation.plots.charts import Chart, Series, charts
from pipeline.evaluation.plots.palette import COLOURS
from pipeline.evaluation.plots.validity_plots import ErrorPanel, error_maps
from pipeline.progress import Progress
from pipeline.surface import statistics

# in wavelengths; off the periods at which an order passes off (Rayleigh), where efficiencies jump
PERIODS = (1.5, 1.9, 2.4, 3.05, 3.8, 4.8, 6.2, 8.6, 12.6, 19.7)
DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
THETAS_DEG = (0.0, 30.0)
_FEWER_PERIODS, _FEWER_DEPTHS, _FEWER_THETAS_DEG = (1.5, 3.8, 6.2), (0.1, 0.3, 0.5), (0.0,)
_SHOWN_DEPTHS = (0.1, 0.3, 0.5)
LAMBDA_MIN_NM, _PLACES_NM = 380.0, (450.0, 550.0, 650.0)

# Lalanne & Hugonin, JOSA A 17, 1033 (2000), tables 1 and 2: a lamellar grating of period, depth and wavelength 1,
# fill 0.5, index 0.22 + 6.71i, light at 30 degrees. With 41 Fourier orders: zeroth order in TM, first in TE
LAMELLAR = coupled_wave.RigorousGrating(
    lambda x: np.where(x < 0.5, 1.0, 0.0), 1.0, float(np.radians(30.0)), 0.22 + 6.71j
)
_PUBLISHED: dict[coupled_wave.Polarisation, tuple[int, float]] = {"TM": (0, 0.84425), "TE": (1, 0.73857)}
# first orders by a boundary-integral method (gratinglab 0.1.12, 600 to 800 nodes, digits that doubling them leaves)
INTEGRAL = {
    ("sinusoid", METAL, 0.0, 1.5, 0.3): 0.4425,
    ("sinusoid", METAL, 30.0, 1.9, 0.3): 0.2846,
    ("sinusoid", METAL, 0.0, 3.05, 0.5): 0.1081,
    ("blaze", METAL, 0.0, 1.5, 0.5): 0.7611,
    ("blaze", METAL, 30.0, 3.05, 0.5): 0.8788,
    ("blaze", METAL, 0.0, 6.2, 0.5): 0.9626,
    ("sinusoid", DIELECTRIC, 0.0, 1.5, 0.3): 0.3912,
    ("sinusoid", DIELECTRIC, 30.0, 1.9, 0.3): 0.4031,
    ("sinusoid", DIELECTRIC, 0.0, 3.05, 0.5): 0.1052,
    ("blaze", DIELECTRIC, 0.0, 1.5, 0.5): 0.9582,
    ("blaze", DIELECTRIC, 30.0, 3.05, 0.5): 0.8817,
    ("blaze", DIELECTRIC, 0.0, 6.2, 0.5): 0.9553,
}
# the accuracy to which the coupled waves are known
RELIABLE = {METAL: 0.01, DIELECTRIC: 0.002}
# at the surface plasmon's resonance TM converges most slowly
RESONANCE = ("sinusoid", METAL, 30.0, 1.9, 0.3)
_DEPTH_COLUMNS = [f"depth up to {depth:g} λ" for depth in scalar_domain.DEPTHS]
_TEXT = PageText("validity", tolerated=scalar_domain.TOLERATED)


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page; without the solver it quotes the table and says so."""
    if not coupled_wave.available():
        return _TEXT.page([_TEXT.check("solver", None)], [_quoted_table(), _places_table(bench)], [])
    periods, depths = (_FEWER_PERIODS, _FEWER_DEPTHS) if bench.quick else (PERIODS, DEPTHS)
    thetas = _FEWER_THETAS_DEG if bench.quick else THETAS_DEG
    found = Sweep(periods, depths, thetas, {})
    found.results.update(sweep(found.cases(), np.array(depths), progress))
    return _TEXT.page(
        checks=[*_published_checks(), *_integral_checks(found), *domain_checks(found, whole=not bench.quick)],
        tables=[
            _quoted_table(),
            _measured_table(found),
            _places_table(bench),
            _TEXT.table("integral", ((*key, a, b, b - a) for key, a, b in _with_integral(found))),
            _orders_table(found),
        ],
        pictures=_pictures(found),
    )


def _published_checks() -> Iterator[Check]:
    """The solver on a published case."""
    for polarisation, (order, value) in _PUBLISHED.items():
        found = coupled_wave.solve(LAMELLAR, np.ones(1), polarisation, coupled_wave.Resolution(20, 2))[0, 20 + order]
        yield _TEXT.check("lamellar.{polarisation}", abs(found - value), polarisation=polarisation, published=value)


def _with_integral(found: Sweep) -> Iterator[tuple[tuple[str, str, float, float, float], float, float]]:
    """Boundary integral and coupled waves, of the gratings that were solved."""
    for key, integral in INTEGRAL.items():
        case, depth = GratingCase(*key[:4]), key[4]
        if case in found.results and depth in found.depths:
            yield key, integral, float(found.results[case].rigorous[found.depths.index(depth)])


def _integral_checks(found: Sweep) -> Iterator[Check]:
    """The reliability of the extrapolated coupled waves."""
    for key, (material, bound) in zip(("metal", "dielectric"), RELIABLE.items(), strict=True):
        off = [abs(a - b) for which, a, b in _with_integral(found) if which[1] == material and which != RESONANCE]
        known = {"key": key, "material": material, "count": len(off)}
        yield _TEXT.check("integral.{key}", max(off), bound=bound, **known)


def domain_checks(found: Sweep, whole: bool) -> Iterator[Check]:
    """The quoted table against this measurement: not below it and, of the whole grid, not far above."""
    for name, shape in SHAPES.items():
        measured = found.by_class(name, "error")
        for period, quoted, errors in zip(scalar_domain.PERIODS, shape.quoted, measured, strict=True):
            above, known = errors - np.array(quoted), {"shape": name, "period": period}
            yield _TEXT.check("{shape}.{period:g}", above.max(), **known)
            if whole:
                yield _TEXT.check("{shape}.{period:g}.slack", -above.min(), **known)


def _quoted_table() -> PageTable:
    rows = [
        (name, period, *row)
        for name, errors in (("smooth", scalar_domain.SMOOTH), ("edged", scalar_domain.EDGED))
        for period, row in zip(scalar_domain.PERIODS, errors, strict=True)
    ]
    return _TEXT.table("quoted", rows, numbers("{:.2f}", *_DEPTH_COLUMNS))


def _measured_table(found: Sweep) -> PageTable:
    """The effect of G / w^2: the largest errors with and without it."""
    models = {"|c_1|² G / w²": "error", "|c_1|² alone": "bare_error"}
    rows = [
        (name, model, period, *row)
        for name in SHAPES
        for model, what in models.items()
        for period, row in zip(scalar_domain.PERIODS, found.by_class(name, what), strict=True)
    ]
    return _TEXT.table("measured", rows, numbers("{:.3f}", *_DEPTH_COLUMNS))


def _places_table(bench: Bench) -> PageTable:
    """The bench's own surfaces in the domain."""
    rows = []
    for surface in (bench.blazed, bench.elaphe, bench.xenopeltis):
        measured = statistics.measure(surface.field, surface.sigma_um, LAMBDA_MIN_NM)
        finest = scalar_domain.finest_period_um(measured.periods)
        for nm in _PLACES_NM:
            at = scalar_domain.place(finest, measured.sigma_h_um, nm)
            errors = ("beyond" if error is None else error for error in (at.smooth, at.edged))
            rows.append((surface.name, nm, (finest, at.period), 1e3 * measured.sigma_h_um, *errors))
    return _TEXT.table("surfaces", rows)


def _orders_table(found: Sweep) -> PageTable:
    rows = [
        (case.shape, case.material, case.theta_deg, case.period, *row)
        for case, each in found.results.items()
        for row in zip(found.depths, each.te, each.tm, each.scalar, each.bare, strict=True)
    ]
    return _TEXT.table("orders", rows)


def _pictures(found: Sweep) -> list[Picture]:
    panels = list(product(SHAPES, INDICES))
    errors = error_maps([_error_panel(found, *each) for each in panels], scalar_domain.TOLERATED)
    rows = [[_efficiency_chart(found, *each, theta) for each in panels] for theta in found.thetas_deg]
    efficiencies = charts(rows, (3.3, 3.0), shared_legend=True)
    return [_TEXT.picture("errors", errors), _TEXT.picture("efficiencies", efficiencies)]


def _error_panel(found: Sweep, shape: str, material: str) -> ErrorPanel:
    errors = np.stack([np.abs(found.grid(shape, material, theta, "error")) for theta in found.thetas_deg])
    values = np.stack([found.grid(shape, material, theta, "rigorous") for theta in found.thetas_deg])
    return ErrorPanel(
        f"{shape}, {material}",
        np.array(found.periods),
        np.array(found.depths),
        np.max(errors, axis=0),
        np.max(errors / values, axis=0),
    )


def _efficiency_chart(found: Sweep, shape: str, material: str, theta_deg: float) -> Chart:
    dense, shown = np.geomspace(PERIODS[0], PERIODS[-1], 160), np.array(_SHOWN_DEPTHS)
    curves = np.array([scalar(GratingCase(shape, material, theta_deg, period), shown) for period in dense])
    solved = found.grid(shape, material, theta_deg, "rigorous")
    series = []
    for i, (depth, colour) in enumerate(zip(_SHOWN_DEPTHS, COLOURS, strict=False)):
        series.append(Series(f"depth {depth:g} λ", dense, curves[:, 0, i], colour, "-"))
        series.append(Series("", dense, curves[:, 1, i], colour, "--"))
        series.append(Series("", found.periods, solved[found.depths.index(depth)], colour, "o"))
    known = {"shape": shape, "material": material, "theta_deg": theta_deg}
    return _TEXT.chart("efficiency", series, y_limits=(0.0, None), **known)
