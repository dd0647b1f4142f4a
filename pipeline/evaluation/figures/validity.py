"""Where the scalar model ends: first orders of gratings beside a rigorous coupled-wave solver's."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.accuracy import scalar_domain
from pipeline.arrays import Array
from pipeline.evaluation.figures import coupled_wave
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Table
from pipeline.evaluation.figures.scalar_errors import (
    DIELECTRIC,
    INDICES,
    METAL,
    SHAPES,
    Case,
    Efficiencies,
    Sweep,
    scalar,
    sweep,
)
from pipeline.progress import Progress
from pipeline.surface import statistics

if TYPE_CHECKING:
    from pipeline.evaluation.plots import validity_plots

# in wavelengths; off the periods at which an order passes off (Rayleigh), where efficiencies jump
PERIODS = (1.5, 1.9, 2.4, 3.05, 3.8, 4.8, 6.2, 8.6, 12.6, 19.7)
DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
THETAS_DEG = (0.0, 30.0)
_FEWER_PERIODS, _FEWER_DEPTHS, _FEWER_THETAS_DEG = (1.5, 3.8, 6.2), (0.1, 0.3, 0.5), (0.0,)
_SHOWN_DEPTHS = (0.1, 0.3, 0.5)
LAMBDA_MIN_NM, _PLACES_NM = 380.0, (450.0, 550.0, 650.0)
# the quoted table may be above the measurement by this much, and not below it
_SLACK = 0.02
_EXTRA = "pip install 'diffract-bake[bench]'"

# Lalanne & Hugonin, JOSA A 17, 1033 (2000), tables 1 and 2: a lamellar grating of period, depth and wavelength 1,
# fill 0.5, index 0.22 + 6.71i, light at 30 degrees. With 41 Fourier orders: zeroth order in TM, first in TE
_LAMELLAR = coupled_wave.Grating(lambda x: np.where(x < 0.5, 1.0, 0.0), 1.0, float(np.radians(30.0)), 0.22 + 6.71j)
_PUBLISHED: dict[coupled_wave.Polarisation, tuple[int, float]] = {"TM": (0, 0.84425), "TE": (1, 0.73857)}
# first orders by a boundary-integral method (gratinglab 0.1.12, 600 to 800 nodes, digits that doubling them leaves)
_INTEGRAL = {
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
# what the coupled waves are known to
_RELIABLE = {METAL: 0.01, DIELECTRIC: 0.002}
# at the surface plasmon's resonance TM converges most slowly
_RESONANCE = ("sinusoid", METAL, 30.0, 1.9, 0.3)


def make(bench: Bench, progress: Progress) -> Figure:
    """The page; without the solver it quotes the table and says so."""
    if not coupled_wave.available():
        return _page([_missing()], [_quoted_table(), _places_table(bench)], [], {})
    periods, depths = (_FEWER_PERIODS, _FEWER_DEPTHS) if bench.quick else (PERIODS, DEPTHS)
    thetas = _FEWER_THETAS_DEG if bench.quick else THETAS_DEG
    found = Sweep(periods, depths, thetas, {})
    found.results.update(sweep(found.cases(), np.array(depths), progress))
    checks = [*_published_checks(), *_integral_checks(found), *_domain_checks(found, whole=not bench.quick)]
    tables = [_quoted_table(), _obliquity_table(found), _places_table(bench), _integral_table(found)]
    return _page(checks, tables, _pictures(found), _numbers(found))


def _error(each: Efficiencies) -> Array:
    return each.error


def _missing() -> Check:
    return Check(
        "coupled-wave solver meent", f"installed ({_EXTRA})", "not installed: the table below is quoted", None
    )


def _published_checks() -> list[Check]:
    """The solver on a published case, order by order of its convergence."""
    checks = []
    for polarisation, (order, value) in _PUBLISHED.items():
        found = coupled_wave.solve(_LAMELLAR, np.ones(1), polarisation, coupled_wave.Resolution(20, 2))[0, 20 + order]
        checks.append(
            Check(
                f"lamellar metal grating in {polarisation}, 41 Fourier orders (Lalanne & Hugonin 2000)",
                f"{value:.5f}",
                f"{found:.5f}",
                abs(found - value) < 1e-5,
            )
        )
    return checks


def _beside_integral(found: Sweep) -> dict[tuple[str, str, float, float, float], tuple[float, float]]:
    """Boundary integral and coupled waves, of the gratings that were solved."""
    beside = {}
    for key, value in _INTEGRAL.items():
        case, depth = Case(*key[:4]), key[4]
        if case in found.results and depth in found.depths:
            beside[key] = value, float(found.results[case].rigorous[found.depths.index(depth)])
    return beside


def _integral_checks(found: Sweep) -> list[Check]:
    """How far extrapolated coupled waves may be trusted."""
    beside = _beside_integral(found)
    checks = []
    for material, bound in _RELIABLE.items():
        differences = [abs(a - b) for key, (a, b) in beside.items() if key[1] == material and key != _RESONANCE]
        checks.append(
            Check(
                f"coupled waves against a boundary integral, {material}, {len(differences)} gratings off resonance",
                f"within {bound:g}",
                f"{max(differences):.4f}",
                max(differences) <= bound,
            )
        )
    return checks


def _integral_table(found: Sweep) -> Table:
    rows = [
        (
            f"{shape}, {material}",
            f"{period:g} λ, {depth:g} λ, {theta:g}°",
            f"{integral:.4f}",
            f"{waves:.4f}",
            f"{waves - integral:+.4f}",
        )
        for (shape, material, theta, period, depth), (integral, waves) in _beside_integral(found).items()
    ]
    return Table(
        "First orders of unpolarised light by two rigorous methods, of the flat surface's reflectance",
        ("grating", "period, depth, light", "boundary integral", "coupled waves", "difference"),
        rows,
    )


def _domain_checks(found: Sweep, whole: bool) -> list[Check]:
    """The quoted table against this measurement: not below it and, of the whole grid, not far above."""
    checks = []
    for name, shape in SHAPES.items():
        for period, quoted, measured in zip(
            scalar_domain.PERIODS, shape.quoted, found.by_class(name, _error), strict=True
        ):
            holds = np.all(measured <= quoted) and (not whole or np.all(np.array(quoted) - measured <= _SLACK))
            depths = " / ".join(f"{depth:g}" for depth in scalar_domain.DEPTHS)
            checks.append(
                Check(
                    f"{name}, periods from {period:g} λ on: largest error at depths up to {depths} λ",
                    " / ".join(f"{each:.2f}" for each in quoted),
                    " / ".join(f"{each:.3f}" for each in measured),
                    bool(holds),
                )
            )
    return checks


def _quoted_table() -> Table:
    rows = [
        (f"{name}, from {period:g} λ", *(f"{error:.2f}" for error in row))
        for name, errors in (("smooth", scalar_domain.SMOOTH), ("edged", scalar_domain.EDGED))
        for period, row in zip(scalar_domain.PERIODS, errors, strict=True)
    ]
    return Table(
        "The domain as quoted: largest error of a first order's efficiency, of the flat surface's reflectance",
        ("relief and period", *(f"depth up to {depth:g} λ" for depth in scalar_domain.DEPTHS)),
        rows,
    )


def _obliquity_table(found: Sweep) -> Table:
    """What G / w^2 does: the largest errors with and without it."""
    ways: tuple[tuple[str, Callable[[Efficiencies], Array]], ...] = (
        ("|c_1|² G / w²", _error),
        ("|c_1|² alone", lambda each: each.bare - each.rigorous),
    )
    rows = [
        (f"{name}, {way}, from {period:g} λ", *(f"{error:.3f}" for error in row))
        for name in SHAPES
        for way, what in ways
        for period, row in zip(scalar_domain.PERIODS[1::2], found.by_class(name, what)[1::2], strict=True)
    ]
    return Table(
        "With the BRDF's obliquity and without it: largest errors",
        ("grating and period", *(f"depth up to {depth:g} λ" for depth in scalar_domain.DEPTHS)),
        rows,
    )


def _places_table(bench: Bench) -> Table:
    """Where the bench's own surfaces lie."""
    rows = []
    for surface in (bench.blazed, bench.elaphe, bench.xenopeltis):
        measured = statistics.measure(surface.field, surface.config.coherence.sigma_um, LAMBDA_MIN_NM)
        finest = scalar_domain.finest_period_um(measured.periods)
        for nm in _PLACES_NM:
            at = scalar_domain.place(finest, measured.sigma_h_um, nm)
            rows.append(
                (
                    f"{surface.name}, {nm:g} nm",
                    f"{finest:.2f} µm, {at.period:.1f} λ",
                    f"{1e3 * measured.sigma_h_um:.0f} nm",
                    *("beyond" if error is None else f"{error:.2f}" for error in (at.smooth, at.edged)),
                )
            )
    columns = ("surface", "finest period", "rms height", "error if smooth", "error if edged")
    return Table("Where the bench's surfaces lie in the table", columns, rows)


def _pictures(found: Sweep) -> list[Picture]:
    from pipeline.evaluation.plots import validity_plots

    panels = list(product(SHAPES, INDICES))
    return [
        Picture(
            validity_plots.error_maps([_error_panel(found, *each) for each in panels], scalar_domain.TOLERATED),
            "The scalar model's error of the first order's efficiency, the largest of all lights. Above as "
            "a share of what the flat surface reflects, below relative to the rigorous value. Black line: 0.05. "
            "Dots: gratings solved.",
        ),
        Picture(
            validity_plots.efficiency_curves(
                [[_efficiency_panel(found, *each, theta) for each in panels] for theta in found.thetas_deg]
            ),
            "First orders of unpolarised light against period, for three depths. Dots: coupled waves. Lines: the "
            "scalar model with its obliquity factor; dashed: |c_1|² alone.",
        ),
    ]


def _error_panel(found: Sweep, shape: str, material: str) -> "validity_plots.ErrorPanel":
    from pipeline.evaluation.plots import validity_plots

    errors = np.stack([np.abs(found.grid(shape, material, theta, "error")) for theta in found.thetas_deg])
    values = np.stack([found.grid(shape, material, theta, "rigorous") for theta in found.thetas_deg])
    return validity_plots.ErrorPanel(
        f"{shape}, {material}",
        np.array(found.periods),
        np.array(found.depths),
        np.max(errors, axis=0),
        np.max(errors / values, axis=0),
    )


def _efficiency_panel(found: Sweep, shape: str, material: str, theta_deg: float) -> "validity_plots.EfficiencyPanel":
    from pipeline.evaluation.plots import validity_plots

    dense, shown = np.geomspace(PERIODS[0], PERIODS[-1], 160), np.array(_SHOWN_DEPTHS)
    curves = np.array([scalar(Case(shape, material, theta_deg, period), shown) for period in dense])
    ours, bare = np.moveaxis(curves, 0, -1)
    solved = found.grid(shape, material, theta_deg, "rigorous")
    rows = [solved[found.depths.index(depth)] for depth in _SHOWN_DEPTHS]
    return validity_plots.EfficiencyPanel(
        f"{shape}, {material}, {theta_deg:g}°", _SHOWN_DEPTHS, np.array(found.periods), rows, dense, ours, bare
    )


def _numbers(found: Sweep) -> dict[str, Any]:
    return {
        "periods": list(found.periods),
        "depths": list(found.depths),
        "largest_error": {name: found.by_class(name, _error).tolist() for name in SHAPES},
        "first_order": {
            f"{case.shape}, {case.material}, {case.theta_deg:g} deg, period {case.period:g}": {
                key: getattr(each, key).tolist() for key in ("te", "tm", "rigorous", "scalar", "bare")
            }
            for case, each in found.results.items()
        },
    }


def _page(
    checks: Sequence[Check], tables: Sequence[Table], pictures: Sequence[Picture], numbers: dict[str, Any]
) -> Figure:
    return Figure(
        name="validity",
        title="Where the scalar model ends",
        source="not in [D14] or [S14]; coupled waves: Moharam et al. 1995",
        expected="Kirchhoff's scalar model knows no polarisation and no light that meets a surface twice. It should "
        "agree with Maxwell's equations in long periods and shallow reliefs, and part from them as either comes "
        "near the wavelength. Its domain is where an order's efficiency errs by less than "
        f"{scalar_domain.TOLERATED:g} of what the flat surface reflects.",
        checks=checks,
        tables=tables,
        pictures=pictures,
        remarks=_REMARKS,
        numbers=numbers,
    )


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
