"""The domain of the scalar model: first orders of gratings against a rigorous coupled-wave solver."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from pipeline.accuracy import scalar_domain
from pipeline.arrays import Array
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import coupled_wave
from pipeline.evaluation.figures.page import Bench, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.figures.scalar_errors import (
    DIELECTRIC,
    INDICES,
    METAL,
    SHAPES,
    Efficiencies,
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
# the quoted table may be above the measurement by this much, and not below it
_SLACK = 0.02

# Lalanne & Hugonin, JOSA A 17, 1033 (2000), tables 1 and 2: a lamellar grating of period, depth and wavelength 1,
# fill 0.5, index 0.22 + 6.71i, light at 30 degrees. With 41 Fourier orders: zeroth order in TM, first in TE
LAMELLAR = coupled_wave.RigorousGrating(
    lambda x: np.where(x < 0.5, 1.0, 0.0), 1.0, float(np.radians(30.0)), 0.22 + 6.71j
)
_PUBLISHED: dict[coupled_wave.Polarisation, tuple[int, float]] = {"TM": (0, 0.84425), "TE": (1, 0.73857)}
_FIVE_DIGITS = 1e-5
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
_REMARKS = (
    (
        "Efficiency: the absolute BRDF R G / (λ² w²) 4πσ² |P|² times cos tr, integrated over the lobe of order m, "
        "is R |c_m|² G / w² = R |c_m|² (1 + wi·wr)² / (cos ti cos tr w²) with R at the half angle; in normal light "
        "R |c_m|² / cos tr. Both sides are divided by the flat surface's reflectance at ti. Aluminium is 1.37 + "
        "7.62i."
    ),
    (
        "Smooth reliefs: with its obliquity factor the model follows Maxwell to 0.01 from periods of 4.8 λ on and to "
        "0.04 from 2.4 λ on, down to depths of λ / 2. |c_1|² alone errs more, most in short periods. Below 2.4 λ "
        "aluminium has resonances in TM (surface plasmons), which no scalar model knows."
    ),
    (
        "Blazes: light meets the vertical facet too. The model overshoots, at the blaze depth of λ / 2 by about "
        "depth / period, and in short periods past 1. There 1 / cos tr makes it worse; at depths below 0.2 λ better."
    ),
    (
        "Coupled waves of a metal's staircase converge slowly in TM, so two resolutions are extrapolated. At the "
        "resonance of the sinusoid of 1.9 λ at 30° they err by up to 0.04, elsewhere by less than 0.01 (a boundary "
        "integral's values, below)."
    ),
)


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page; without the solver it quotes the table and says so."""
    if not coupled_wave.available():
        return _page([_missing()], [_quoted_table(), _places_table(bench)], [])
    periods, depths = (_FEWER_PERIODS, _FEWER_DEPTHS) if bench.quick else (PERIODS, DEPTHS)
    thetas = _FEWER_THETAS_DEG if bench.quick else THETAS_DEG
    found = Sweep(periods, depths, thetas, {})
    found.results.update(sweep(found.cases(), np.array(depths), progress))
    checks = [*_published_checks(), *_integral_checks(found), *domain_checks(found, whole=not bench.quick)]
    tables = [
        _quoted_table(),
        _measured_table(found),
        _places_table(bench),
        _integral_table(found),
        _orders_table(found),
    ]
    return _page(checks, tables, _pictures(found))


def _page(checks: Sequence[Check], tables: Sequence[PageTable], pictures: Sequence[Picture]) -> Page:
    return Page(
        name="validity",
        title="The domain of the scalar model",
        source="not in [D14] or [S14]; coupled waves: Moharam et al. 1995",
        expected="Kirchhoff's scalar model knows no polarisation and no light that meets a surface twice. It should "
        "agree with Maxwell's equations in long periods and shallow reliefs, and depart from them as either comes "
        "near the wavelength. Its domain is where an order's efficiency errs by less than "
        f"{scalar_domain.TOLERATED:g} of the flat surface's reflectance.",
        checks=checks,
        tables=tables,
        pictures=pictures,
        remarks=_REMARKS,
    )


def _missing() -> Check:
    return Check(
        "solver",
        "coupled-wave solver meent: not installed, the table below is quoted",
        None,
        remark="pip install 'diffract-bake[bench]'",
    )


def _error(each: Efficiencies) -> Array:
    return each.error


def _published_checks() -> Iterator[Check]:
    """The solver on a published case."""
    for polarisation, (order, value) in _PUBLISHED.items():
        found = coupled_wave.solve(LAMELLAR, np.ones(1), polarisation, coupled_wave.Resolution(20, 2))[0, 20 + order]
        what = (
            f"lamellar metal grating in {polarisation}, 41 Fourier orders: difference from the published {value:.5f}"
        )
        source = "Lalanne & Hugonin 2000"
        yield Check(f"lamellar.{polarisation}", what, abs(found - value), "<", _FIVE_DIGITS, source=source)


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
        what = f"coupled waves against a boundary integral, {material}, {len(off)} gratings off resonance"
        yield Check(f"integral.{key}", what, max(off), "<=", bound, source="gratinglab")


def domain_checks(found: Sweep, whole: bool) -> Iterator[Check]:
    """The quoted table against this measurement: not below it and, of the whole grid, not far above."""
    for name, shape in SHAPES.items():
        measured = found.by_class(name, _error)
        for period, quoted, errors in zip(scalar_domain.PERIODS, shape.quoted, measured, strict=True):
            above, on = errors - np.array(quoted), f"{name}, periods from {period:g} λ on"
            what = f"{on}: largest excess of the measured error over the quoted one"
            yield Check(f"{name}.{period:g}", what, above.max(), "<=", 0.0, source="docs/accuracy.md")
            if whole:
                what = f"{on}: largest excess of the quoted error over the measured one"
                yield Check(f"{name}.{period:g}.slack", what, -above.min(), "<=", _SLACK, source="docs/accuracy.md")


def _quoted_table() -> PageTable:
    return PageTable(
        "quoted",
        "The domain as quoted: largest error of a first order's efficiency, of the flat surface's reflectance",
        [Column("relief"), Column("periods from", "{:g} λ"), *numbers("{:.2f}", *_DEPTH_COLUMNS)],
        [
            (name, period, *row)
            for name, errors in (("smooth", scalar_domain.SMOOTH), ("edged", scalar_domain.EDGED))
            for period, row in zip(scalar_domain.PERIODS, errors, strict=True)
        ],
    )


def _measured_table(found: Sweep) -> PageTable:
    """The effect of G / w^2: the largest errors with and without it."""
    models: tuple[tuple[str, Callable[[Efficiencies], Array]], ...] = (
        ("|c_1|² G / w²", _error),
        ("|c_1|² alone", lambda each: each.bare - each.rigorous),
    )
    return PageTable(
        "measured",
        "Largest errors as measured here, with the BRDF's obliquity and without it",
        [*numbers("{}", "grating", "model"), Column("periods from", "{:g} λ"), *numbers("{:.3f}", *_DEPTH_COLUMNS)],
        [
            (name, model, period, *row)
            for name in SHAPES
            for model, error in models
            for period, row in zip(scalar_domain.PERIODS, found.by_class(name, error), strict=True)
        ],
    )


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
    return PageTable(
        "surfaces",
        "The bench's surfaces in the table",
        [
            Column("surface"),
            Column("wavelength", "{:g} nm"),
            Column("finest period", "{:.2f} µm, {:.1f} λ"),
            Column("rms height", "{:.0f} nm"),
            *numbers("{:.2f}", "error if smooth", "error if edged"),
        ],
        rows,
    )


_CASE_COLUMNS = (
    *numbers("{}", "shape", "material"),
    Column("light", "{:g}°"),
    *numbers("{:g} λ", "period", "depth"),
)


def _integral_table(found: Sweep) -> PageTable:
    return PageTable(
        "integral",
        "First orders of unpolarised light by two rigorous methods, of the flat surface's reflectance",
        [
            *_CASE_COLUMNS,
            *numbers("{:.4f}", "boundary integral", "coupled waves"),
            Column("difference", "{:+.4f}"),
        ],
        [(*key, integral, waves, waves - integral) for key, integral, waves in _with_integral(found)],
    )


def _orders_table(found: Sweep) -> PageTable:
    return PageTable(
        "orders",
        "First orders of every case that was solved, of the flat surface's reflectance",
        [*_CASE_COLUMNS, *numbers("{:.4f}", "TE", "TM", "|c_1|² G / w²", "|c_1|² alone")],
        [
            (case.shape, case.material, case.theta_deg, case.period, *row)
            for case, each in found.results.items()
            for row in zip(found.depths, each.te, each.tm, each.scalar, each.bare, strict=True)
        ],
    )


def _pictures(found: Sweep) -> list[Picture]:
    panels = list(product(SHAPES, INDICES))
    return [
        Picture(
            error_maps([_error_panel(found, *each) for each in panels], scalar_domain.TOLERATED),
            "The scalar model's error of the first order's efficiency, the largest of all lights. Above as "
            "a share of what the flat surface reflects, below relative to the rigorous value. Black line: 0.05. "
            "Dots: gratings solved.",
        ),
        Picture(
            charts(
                [[_efficiency_chart(found, *each, theta) for each in panels] for theta in found.thetas_deg],
                (3.3, 3.0),
                shared_legend=True,
            ),
            "First orders of unpolarised light against period, for three depths. Circles: coupled waves. Lines: the "
            "scalar model with its obliquity factor; dashed: |c_1|² alone.",
        ),
    ]


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
    return Chart(
        f"{shape}, {material}, {theta_deg:g}°",
        "period / wavelength",
        "efficiency of m = 1",
        series,
        x_scale="log",
        y_scale="linear",
        y_limits=(0.0, None),
    )
