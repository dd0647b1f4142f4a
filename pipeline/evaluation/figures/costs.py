"""Run time and error of all methods in one plot, on Elaphe."""

from pipeline.evaluation.figures import maps
from pipeline.evaluation.figures.maps import SHOWN_RU, STRICT_RU, Run, on_elaphe
from pipeline.evaluation.figures.page import Bench, Cell, Page, PageText
from pipeline.evaluation.methods.catalogue import EXACT, METHODS, OURS, PAPER
from pipeline.evaluation.plots import map_plots
from pipeline.evaluation.plots.palette import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from pipeline.progress import Progress

_COLOURS = {"[D14]": VERMILION, "[S14]": GREEN, "[S99]": PURPLE, "[G04]": ORANGE}


def make(bench: Bench, progress: Progress) -> Page:
    """Make the page: every method's preparation, storage, time and error on Elaphe at normal incidence."""
    surface, runs = bench.elaphe, {}
    for done, name in enumerate(METHODS, start=1):
        runs[name] = on_elaphe(bench, name)
        progress("costs of methods", done / len(METHODS))
    truth = runs[EXACT].xyz
    errors = {
        name: {ru: maps.mean_delta_e(surface, each.xyz, truth, ru) for ru in maps.EXPOSURES_RU}
        for name, each in runs.items()
    }
    text, views = PageText("costs", shown=SHOWN_RU, strict=STRICT_RU), maps.views_of(bench)
    strict = {name: error[STRICT_RU] for name, error in errors.items()}
    better = [name for name, run in runs.items() if run.total_s < runs[OURS].total_s and strict[name] < strict[OURS]]
    rows = [(*_costs(runs[name]), *errors[name].values()) for name in sorted(runs, key=lambda name: strict[name])]
    return text.page(
        checks=[
            text.check("error.paper_over_ours", strict[PAPER] / strict[OURS]),
            text.check("methods.quicker_and_better", len(better), remark=", ".join(better)),
        ],
        tables=[text.table("methods", rows, size=views.size)],
        pictures=[text.picture("costs", _plot(runs, strict, surface.name))],
    )


def _costs(run: Run) -> tuple[Cell, ...]:
    """Name, source, seconds of the preparation, MB, seconds of the map and us a view."""
    method = run.method
    views = len(run.xyz)
    return run.name, method.source, run.prepare_s, 1e-6 * method.stored_bytes, run.map_s, 1e6 * run.map_s / views


def _plot(runs: dict[str, Run], errors: dict[str, float], surface: str) -> bytes:
    def colour(source: str) -> str:
        return next((found for tag, found in _COLOURS.items() if source.startswith(tag)), BLUE)

    points = [
        map_plots.Cost(name, each.map_s, each.total_s, errors[name], colour(each.method.source))
        for name, each in runs.items()
        if name != EXACT
    ]
    label, exact = f"mean ΔE at {STRICT_RU:g} RU", (runs[EXACT].total_s, EXACT)
    return map_plots.costs(points, label, f"Every method on {surface}", exact)
