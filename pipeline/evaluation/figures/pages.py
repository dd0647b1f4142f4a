"""The pages of the validation bench in order, and the command that makes them all."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from pipeline.errors import BakeError
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.page import Bench, Page
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

    page: Page
    seconds: float


def make_all(bench: Bench, progress: Progress, note: Callable[[str], None]) -> Iterator[Made]:
    """Make every page, one after the other; `note` is called with a line about each."""
    for name in PAGES:
        started = time.perf_counter()
        try:
            page = import_module(f"pipeline.evaluation.figures.{name}").make(bench, progress)
        except BakeError as error:
            page = _not_made(name, error)
        made = Made(page, time.perf_counter() - started)
        note(f"  {name:<20} {made.seconds:5.1f} s")
        yield made


def _not_made(name: str, error: BakeError) -> Page:
    """A page that these surfaces do not allow states the reason, and the other pages are made."""
    reason = " ".join(str(error).split())
    check = Check("made", f"page of these surfaces ({reason})", 0, ">=", 1)
    return Page(
        name=name, title=f"{name.replace('_', ' ').capitalize()}: not made", source="", expected="", checks=[check]
    )


def document(made: Sequence[Made]) -> dict[str, Any]:
    """Return everything that was measured, for JSON."""
    return {
        "versions": provenance.versions(),
        "device": provenance.device(),
        "pages": [{**each.page.document(), "seconds": each.seconds} for each in made],
    }
