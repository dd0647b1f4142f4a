"""Run time and error of all methods in one plot, on Elaphe."""

from collections.abc import Sequence

from pipeline.evaluation.figures.exact_maps import SHOWN_RU, STRICT_RU, mean_delta_e, views_of
from pipeline.evaluation.figures.figure import Bench, Check, Figure, Picture, Surface, Table
from pipeline.evaluation.figures.method_runs import EXACT_NAME, OURS, PAPER, Run, on_elaphe
from pipeline.evaluation.methods.catalogue import METHODS
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_TIMES_BELOW = 10.0
_LITERATURE_COLOURS = {"[D14]": "#d55e00", "[S14]": "#009e73", "[S99]": "#cc79a7", "[G04]": "#e69f00"}
_OUR_COLOUR = "#0072b2"
_TIMING = (
    "Seconds are of this machine, once each, kernels compiled beforehand. From the height field to the map; a second "
    "map, or a frame, costs the map alone. All methods answer the same directions through the same interface."
)
_GEMS = (
    "GPU Gems has no radiometry and one axis: its error over a whole map says that it is no model of this surface."
)


def make(bench: Bench, progress: Progress) -> Figure:
    """The page: every method's preparation, storage, time and error on Elaphe at normal incidence."""
    surface, views = bench.elaphe, views_of(bench)
    runs = []
    for done, name in enumerate(METHODS, start=1):
        runs.append(on_elaphe(bench, name))
        progress("costs of methods", done / len(METHODS))
    exact = next(each for each in runs if each.name == EXACT_NAME)
    errors = {each.name: _errors(surface, each, exact) for each in runs}
    return Figure(
        name="costs",
        title="Run time and error of all methods",
        source="[D14] sec. 7, [S14] 1.5.2",
        expected="A table costs its preparation once and little for every look-up; ours errs at least ten times less "
        "than the paper's.",
        checks=_checks(runs, errors),
        tables=[_table(runs, errors, views)],
        pictures=[_picture(runs, errors, surface, exact)],
        remarks=[_TIMING, _GEMS],
        numbers={
            each.name: {
                "prepare_s": each.prepare_s,
                "map_s": each.map_s,
                "stored_bytes": each.method.stored_bytes,
                "mean_delta_e_7500": errors[each.name][1],
            }
            for each in runs
        },
    )


def _errors(surface: Surface, found: Run, exact: Run) -> tuple[float, float]:
    """Mean dE at 1500 and at 7500 RU."""
    shown, strict = (mean_delta_e(surface.config, found.xyz, exact.xyz, ru) for ru in (SHOWN_RU, STRICT_RU))
    return shown, strict


def _checks(runs: Sequence[Run], errors: dict[str, tuple[float, float]]) -> list[Check]:
    ours = next(each for each in runs if each.name == OURS)
    better = errors[PAPER][1] / errors[OURS][1]
    quicker = [each.name for each in runs if each.total_s < ours.total_s and errors[each.name][1] < errors[OURS][1]]
    return [
        Check(
            f"mean ΔE at {STRICT_RU:g} RU of the paper's table over ours",
            f"at least {_TIMES_BELOW:g}",
            f"{better:.1f} ({errors[PAPER][1]:.2f} over {errors[OURS][1]:.3f})",
            better >= _TIMES_BELOW,
        ),
        Check(
            "ways that are quicker from height field to map and err less than this project's table",
            "none",
            ", ".join(quicker) or "none",
            None,
        ),
    ]


def _table(runs: Sequence[Run], errors: dict[str, tuple[float, float]], views: Map) -> Table:
    rows = [
        [
            each.name,
            each.method.source,
            f"{each.prepare_s:.2f}",
            _bytes(each.method.stored_bytes),
            f"{each.map_s:.3f}",
            f"{1e6 * each.map_s / len(each.xyz):.2f}",
            *(f"{error:.3g}" for error in errors[each.name]),
        ]
        for each in sorted(runs, key=lambda each: errors[each.name][1])
    ]
    columns = [
        "method",
        "source",
        "prepares (s)",
        "keeps",
        "map (s)",
        "a view (us)",
        "mean ΔE, 1500 RU",
        "mean ΔE, 7500 RU",
    ]
    return Table(f"Every method on Elaphe, a map of {views.size} x {views.size}, normal incidence", columns, rows)


def _bytes(count: int) -> str:
    return f"{1e-6 * count:.1f} MB" if count >= 1e5 else f"{count} B"


def _picture(runs: Sequence[Run], errors: dict[str, tuple[float, float]], surface: Surface, exact: Run) -> Picture:
    from pipeline.evaluation.plots import map_plots

    points = [
        map_plots.Cost(each.name, each.map_s, each.total_s, errors[each.name][1], _colour(each))
        for each in runs
        if each.name != EXACT_NAME
    ]
    label = f"mean ΔE at {STRICT_RU:g} RU"
    png = map_plots.costs(points, label, f"Every method on {surface.name}", (exact.total_s, EXACT_NAME))
    return Picture(png, "Seconds against mean error. Exact, without error, is a line.")


def _colour(found: Run) -> str:
    return next(
        (c for source, c in _LITERATURE_COLOURS.items() if found.method.source.startswith(source)), _OUR_COLOUR
    )
