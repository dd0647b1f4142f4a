"""One page of the validation bench: what was expected, what was measured, and the verdict."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipeline.config.models import Config
from pipeline.progress import Progress
from pipeline.surface.heightfield import HeightField

if TYPE_CHECKING:
    from pipeline.evaluation.figures.method_runs import Run


@dataclass(frozen=True)
class Check:
    """One statement of a page. holds: None where it is told beside a published value and not judged."""

    what: str
    expected: str
    measured: str
    holds: bool | None

    def __post_init__(self) -> None:
        # comparisons of numpy's numbers give numpy's truth, which neither `is True` nor JSON knows
        object.__setattr__(self, "holds", None if self.holds is None else bool(self.holds))

    @property
    def verdict(self) -> str:
        """In a word."""
        return "told" if self.holds is None else "holds" if self.holds else "MISSES"


@dataclass(frozen=True)
class Table:
    """Rows of text under column names, and what they tell."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """A PNG and what it shows."""

    png: bytes
    caption: str


@dataclass(frozen=True)
class Figure:
    """A page.

    name: of its file. source: the figure or table it stands beside. expected: what the source or theory says, in a
    sentence or two. remarks: what explains a difference. numbers: everything measured, for machines.
    """

    name: str
    title: str
    source: str
    expected: str
    checks: Sequence[Check]
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    remarks: Sequence[str] = ()
    numbers: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Surface:
    """A surface of the bench. scan: whether it was measured, and not made by a recipe."""

    config: Config
    field: HeightField
    scan: bool

    @property
    def name(self) -> str:
        return self.config.name


@dataclass(frozen=True)
class Bench:
    """What the pages are made of.

    quick: smaller maps and fewer points, for a first look and for tests. runs: methods at work on Elaphe, by name,
    which several pages show (pipeline.evaluation.figures.method_runs).
    """

    blazed: Surface
    elaphe: Surface
    xenopeltis: Surface
    quick: bool
    runs: "dict[str, Run]" = field(default_factory=dict, init=False, repr=False, compare=False)


# a page's maker
MakeFigure = Callable[[Bench, Progress], Figure]
