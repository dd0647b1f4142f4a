"""The pages of the validation bench, in order, and making them all."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any

import numpy as np

from pipeline.errors import BakeError
from pipeline.evaluation.figures.figure import Bench, Check, Figure
from pipeline.progress import Progress
from pipeline.stages import provenance

# modules of this package, each with a `make`; imported when their turn comes
PAGES = (
    "viewing_angles",
    "screen",
    "brdf_maps",
    "grids",
    "terms",
    "coherence_length",
    "wavelength_step",
    "methods_sheet",
    "order_efficiencies",
    "energy",
    "validity",
    "costs",
)


@dataclass(frozen=True)
class Made:
    """A page and the seconds it took."""

    figure: Figure
    seconds: float


def make_all(bench: Bench, progress: Progress, tell: Callable[[str], None]) -> Iterator[Made]:
    """Every page, one after the other; `tell` hears of each."""
    for name in PAGES:
        started = time.perf_counter()
        try:
            figure = import_module(f"pipeline.evaluation.figures.{name}").make(bench, progress)
        except BakeError as error:
            figure = _not_made(name, error)
        made = Made(figure, time.perf_counter() - started)
        tell(f"  {name:<20} {made.seconds:5.1f} s")
        yield made


def _not_made(name: str, error: BakeError) -> Figure:
    """A page that these surfaces do not allow says so, and takes no other page with it."""
    reason = " ".join(str(error).split())
    return Figure(
        name=name,
        title=f"{name.replace('_', ' ').capitalize()}: not made",
        source="",
        expected="",
        checks=[Check("this page, of these surfaces", "made", reason, False)],
    )


def document(made: Sequence[Made]) -> dict[str, Any]:
    """All that was measured, for machines."""
    return {
        "versions": provenance.versions(),
        "device": provenance.device(),
        "pages": [
            {
                "name": page.figure.name,
                "title": page.figure.title,
                "source": page.figure.source,
                "seconds": page.seconds,
                "checks": [asdict(check) for check in page.figure.checks],
                "numbers": _plain(page.figure.numbers),
            }
            for page in made
        ],
    }


def _plain(value: Any) -> Any:
    """Without numpy's types, which JSON does not know."""
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
