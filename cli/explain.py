"""Predicted beside actual time, bytes and error of the stages of a run, from which the next prediction learns."""

from typing import TYPE_CHECKING, Any

from cli import console

if TYPE_CHECKING:
    from pipeline.batch.turns import Turn
    from pipeline.stages.run import Explanation, Step
    from pipeline.store.store import Store

_COLUMNS = ("stage", "predicted", "actual", "bytes predicted", "actual", "peak predicted")


class Explained:
    """The predictions of a config's stages, made before the first one runs, and what the run then took."""

    def __init__(self, turn: "Turn", store: "Store") -> None:
        """Predicts all stages of a config's plan, as if it were alone."""
        from pipeline.stages import run

        config, steps = turn.config, turn.steps
        # what a config does not compute because another did says nothing of one that is alone
        self._is_alone = turn.session.derived_bytes == 0
        self._store = store
        self._predicted = dict(zip((s.stage.name for s in steps), run.explain(config, steps, store), strict=True))

    def add(self, step: "Step", seconds: float | None, result: dict[str, Any]) -> None:
        """Adds prediction and outcome of a step to its result as JSON, and learns from its time.

        seconds: that it took; None where it was cached, of which there is nothing to learn.
        """
        from pipeline.stages import cost

        expected, artifact = self._predicted[step.stage.name], self._store.describe(step.stage.name, step.key)
        certificate = artifact.summary.get("certificate") if step.stage.name == "table" else None
        measured = None if certificate is None else certificate["measured"]
        result["predicted"] = as_json(expected)
        result["actual"] = {"seconds": seconds, "bytes": artifact.bytes, "delta_e": measured}
        if self._is_alone and seconds is not None and expected.need is not None:
            cost.keep(cost.machine(self._store).learned(step.stage.name, expected.need, seconds), self._store)


def as_json(expected: "Explanation") -> dict[str, Any]:
    """Returns the numbers of a prediction."""
    return {
        "seconds": expected.seconds,
        "bytes": expected.bytes,
        "peak_bytes": None if expected.need is None else expected.need.bytes,
        "delta_e": expected.delta_e,
    }


def show(result: dict[str, Any]) -> None:
    """Prints predicted beside actual numbers of a config: time of the stages that were made, bytes, error."""
    rows, totals, error = [], [0.0, 0.0], ""
    for name, stage in result["stages"].items():
        predicted, actual = stage["predicted"], stage["actual"]
        made = actual["seconds"] is not None
        if made and predicted["seconds"] is not None:
            totals = [totals[0] + predicted["seconds"], totals[1] + actual["seconds"]]
        rows.append(
            [
                name,
                seconds(predicted["seconds"]) if made else "-",
                seconds(actual["seconds"]) if made else "cached",
                size(predicted["bytes"]),
                size(actual["bytes"]),
                size(predicted["peak_bytes"]),
            ]
        )
        if predicted["delta_e"] is not None and actual["delta_e"] is not None:
            error = f"; mean CIELAB error {actual['delta_e']:.3f}, {predicted['delta_e']:.3f} predicted"
    console.print_table(_COLUMNS, rows)
    console.say(f"{result['name']}: {totals[1]:.1f} s, {totals[0]:.1f} s predicted{error}")


def seconds(value: float | None) -> str:
    """Writes a time, s."""
    return "unknown" if value is None else f"{value:.2g} s" if value < 10.0 else f"{value:.0f} s"


def size(value: int | None) -> str:
    """Writes a size in bytes."""
    from pipeline.resources import in_words

    return "unknown" if value is None else in_words(value)
