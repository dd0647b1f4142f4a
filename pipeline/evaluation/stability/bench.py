"""`bench stability`: the sweep, its criterion, and the files that hold them."""

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
        from pipeline.evaluation.plots import stability_plots

        return {
            "stability.json": results.json_text(self.document()),
            "stability.csv": results.csv_text([_row(outcome) for outcome in self.outcomes]),
            "stability.png": stability_plots.error_by_height(self.outcomes),
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
