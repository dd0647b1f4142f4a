"""`bench stability`: the sweep, its criterion, and the files that hold them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation import results
from pipeline.evaluation.check import Check
from pipeline.evaluation.stability import sweep, verdict
from pipeline.evaluation.stability.verdict import Outcome
from pipeline.progress import Progress


@dataclass(frozen=True)
class StabilityResults:
    """Every test case with its outcome, and the checks of the Taylor / Chebyshev criterion."""

    outcomes: list[Outcome]
    checks: list[Check]

    @property
    def faults(self) -> list[str]:
        """A line for each case that misses its tolerance, and where all hold, for each check of the criterion."""
        cases = [
            f"{o.case}: {o.check.remark or f'{o.check.measured}, expected {o.check.expected}'}"
            for o in self.outcomes
            if o.verdict == "misses"
        ]
        missed = [check for check in self.checks if check.verdict == "misses"]
        return cases or [f"{check.what}: {check.measured}, expected {check.expected}" for check in missed]

    def document(self) -> dict[str, Any]:
        """Return all results for JSON."""
        return results.document(self.checks, cases=[_row(outcome) for outcome in self.outcomes])

    def files(self) -> dict[str, str | bytes]:
        """Return stability.json, stability.csv (a row a case) and stability.png by name."""
        return {
            "stability.json": results.json_text(self.document()),
            "stability.csv": results.csv_text([_row(outcome) for outcome in self.outcomes]),
            "stability.png": _error_by_height(self.outcomes),
        }


def run(quick: bool, progress: Progress) -> StabilityResults:
    """Run the sweep. quick: a part of it that takes seconds."""
    outcomes = verdict.sweep(sweep.cases(quick), progress)
    return StabilityResults(outcomes, verdict.criterion(outcomes))


def _row(outcome: Outcome) -> dict[str, Any]:
    check = outcome.check
    return {
        "id": check.id,
        **results.plain(outcome.case),
        "verdict": outcome.verdict,
        "error": check.value,
        "tolerance": outcome.tolerance,
        "speckle_error": outcome.speckle_error,
        "message": check.remark,
    }


def _error_by_height(outcomes: Sequence[Outcome]) -> bytes:
    """The worst error of |P|^2 against the span of heights, a curve a basis and precision, PNG."""
    from pipeline.evaluation.plots import palette
    from pipeline.evaluation.plots.charts import Chart, Series, charts

    by_height = [outcome for outcome in outcomes if outcome.case.family.startswith("height")]
    series = []
    for (basis, precision), colour in zip(
        sweep.SERIES, (palette.ORANGE, palette.VERMILION, palette.SKY, palette.BLUE), strict=True
    ):
        for algorithm, style, where in (("series", ".-", ""), ("device", "o", ", on the device")):
            points = sorted(
                (outcome.case.height_um, outcome.speckle_error)
                for outcome in by_height
                if outcome.speckle_error is not None
                and (outcome.case.algorithm, outcome.case.basis, outcome.case.precision)
                == (algorithm, basis, precision)
            )
            if points:
                label, (heights, errors) = f"{basis.capitalize()}, {precision}{where}", zip(*points, strict=True)
                series.append(Series(label, heights, errors, colour, style))
    refused = [outcome.case.height_um for outcome in by_height if outcome.verdict == "refused"]
    chart = Chart(
        "Taylor fails where Chebyshev holds",
        "span of heights (µm)",
        "worst error of |P|² / max(|P|², 1e-3 of its mean)",
        series,
        x_scale="log",
        marks=[(min(refused), "the paper's tables are refused from here")] if refused else [],
        level=(verdict.CHEBYSHEV_TOLERANCE, "tolerance of Chebyshev, float32"),
        floor=1e-13,
        y_limits=(1e-13, 1e3),
    )
    return charts([[chart]], (8.6, 5.2))
