"""Run time and error of all methods in one plot, on Elaphe."""

from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import STRICT_RU
from pipeline.evaluation.figures.method_runs import Run, on_elaphe
from pipeline.evaluation.figures.page import Bench, Column, Page, PageTable, Picture, numbers
from pipeline.evaluation.methods.catalogue import EXACT, METHODS, OURS, PAPER
from pipeline.evaluation.plots import map_plots
from pipeline.evaluation.plots.palette import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from pipeline.progress import Progress
from pipeline.tables.evaluate import Map

_TIMES_BELOW = 10.0
_COLOURS = {"[D14]": VERMILION, "[S14]": GREEN, "[S99]": PURPLE, "[G04]": ORANGE}
_TIMING = (
    "Seconds are of this machine, measured once, kernels compiled beforehand, from the height field to the map; a "
    "second map, or a frame, costs the map alone. All methods answer the same directions through the same interface."
)
_GEMS = (
    "GPU Gems has no radiometry and one axis: its error over a whole map shows that it is no model of this surface."
)

# mean dE by exposure in RU, by method
_Errors = dict[str, dict[float, float]]


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: every method's preparation, storage, time and error on Elaphe at normal incidence."""
    surface, runs = bench.elaphe, {}
    for done, name in enumerate(METHODS, start=1):
        runs[name] = on_elaphe(bench, name)
        progress("costs of methods", done / len(METHODS))
    truth = runs[EXACT].xyz
    errors: _Errors = {
        name: {ru: maps.mean_delta_e(surface, each.xyz, truth, ru) for ru in maps.EXPOSURES_RU}
        for name, each in runs.items()
    }
    return Page(
        name="costs",
        title="Run time and error of all methods",
        source="[D14] sec. 7, [S14] 1.5.2",
        expected="A table costs its preparation once and little for every look-up; ours errs at least ten times less "
        "than the paper's.",
        checks=_checks(runs, errors),
        tables=[_table(runs, errors, maps.views_of(bench))],
        pictures=[_picture(runs, errors, surface.name)],
        remarks=[_TIMING, _GEMS],
    )


def _checks(runs: dict[str, Run], errors: _Errors) -> list[Check]:
    ours, error = runs[OURS], errors[OURS][STRICT_RU]
    better = [name for name, each in runs.items() if each.total_s < ours.total_s and errors[name][STRICT_RU] < error]
    ratio = errors[PAPER][STRICT_RU] / error
    return [
        Check(
            "error.paper_over_ours",
            f"mean ΔE at {STRICT_RU:g} RU of the paper's table over ours",
            ratio,
            ">=",
            _TIMES_BELOW,
        ),
        Check(
            "methods.quicker_and_better",
            "methods that are quicker from height field to map and err less than this project's table",
            len(better),
            "=",
            0.0,
            remark=", ".join(better),
        ),
    ]


def _table(runs: dict[str, Run], errors: _Errors, views: Map) -> PageTable:
    return PageTable(
        "methods",
        f"Every method on Elaphe, a map of {views.size} x {views.size}, normal incidence",
        [
            *numbers("{}", "method", "source"),
            Column("prepares (s)", "{:.2f}"),
            Column("keeps (MB)", "{:.3g}"),
            Column("map (s)", "{:.3f}"),
            Column("a view (µs)", "{:.2f}"),
            *numbers("{:.3g}", *maps.ERROR_COLUMNS),
        ],
        [
            (
                each.name,
                each.method.source,
                each.prepare_s,
                1e-6 * each.method.stored_bytes,
                each.map_s,
                1e6 * each.map_s / len(each.xyz),
                *errors[each.name].values(),
            )
            for each in sorted(runs.values(), key=lambda each: errors[each.name][STRICT_RU])
        ],
    )


def _picture(runs: dict[str, Run], errors: _Errors, surface: str) -> Picture:
    def colour(source: str) -> str:
        return next((found for tag, found in _COLOURS.items() if source.startswith(tag)), BLUE)

    points = [
        map_plots.Cost(name, each.map_s, each.total_s, errors[name][STRICT_RU], colour(each.method.source))
        for name, each in runs.items()
        if name != EXACT
    ]
    label, exact = f"mean ΔE at {STRICT_RU:g} RU", (runs[EXACT].total_s, EXACT)
    png = map_plots.costs(points, label, f"Every method on {surface}", exact)
    return Picture(png, "Seconds against mean error. Exact, without error, is a line.")
