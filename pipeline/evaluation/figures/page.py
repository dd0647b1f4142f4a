"""One page of the validation bench: checks, tables of typed columns and pictures; and the surfaces it is made of."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation.check import Check
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

if TYPE_CHECKING:
    from pipeline.evaluation.figures.method_runs import Run

# a number, several that are written together, a text, or nothing
Cell = float | tuple[float, ...] | str | None


@dataclass(frozen=True)
class Column:
    """A column of a page's table. name: its heading. form: template of str.format for its numbers."""

    name: str
    form: str = "{}"

    def text(self, cell: Cell) -> str:
        """Return a cell as text; texts stay as they are, and nothing is empty."""
        if cell is None or isinstance(cell, str):
            return cell or ""
        return self.form.format(*cell) if isinstance(cell, tuple) else self.form.format(cell)


def numbers(form: str, *names: str) -> list[Column]:
    """Return columns of one format."""
    return [Column(name, form) for name in names]


@dataclass(frozen=True)
class PageTable:
    """A table of a page, from which both its text and its JSON are made. id: unique on its page."""

    id: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]

    @property
    def headings(self) -> list[str]:
        """Names of the columns."""
        return [column.name for column in self.columns]

    @property
    def texts(self) -> list[list[str]]:
        """Every row as text."""
        return [[column.text(cell) for column, cell in zip(self.columns, row, strict=True)] for row in self.rows]

    @property
    def records(self) -> list[dict[str, Any]]:
        """Every row as numbers by column, for JSON: what is not finite is None."""
        return [dict(zip(self.headings, map(_plain, row), strict=True)) for row in self.rows]


def _plain(cell: Cell) -> Any:
    if isinstance(cell, tuple):
        return [_plain(each) for each in cell]
    if cell is None or isinstance(cell, str):
        return cell
    return float(cell) if isfinite(cell) else None


@dataclass(frozen=True)
class Picture:
    """A PNG and its caption."""

    png: bytes
    caption: str


@dataclass(frozen=True)
class Page:
    """A page.

    name: of its file. source: the figure or table that it reproduces. expected: the prediction of source or theory,
    in a sentence or two. remarks: explanations of differences.
    """

    name: str
    title: str
    source: str
    expected: str
    checks: Sequence[Check]
    tables: Sequence[PageTable] = ()
    pictures: Sequence[Picture] = ()
    remarks: Sequence[str] = ()

    def document(self) -> dict[str, Any]:
        """Return everything that was measured, for JSON; a check without a source of its own has the page's."""
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source,
            "checks": [
                {
                    key: _plain(value)
                    for key, value in replace(check, source=check.source or self.source).document().items()
                }
                for check in self.checks
            ],
            "tables": {table.id: table.records for table in self.tables},
        }


@dataclass(frozen=True)
class BenchSurface:
    """A surface of the bench. scan: whether it was measured, and not made by a recipe."""

    config: Config
    field: HeightField
    scan: bool

    @property
    def name(self) -> str:
        return self.config.name

    @property
    def sigma_um(self) -> float:
        """Width of the coherence window."""
        return self.config.coherence.sigma_um

    @property
    def unit(self) -> float:
        """XYZ of 1 RU."""
        return self.config.radiometry.unit

    def reference(self, progress: Progress = silent) -> Reference:
        """Prepare the exact reference under the config's window.

        Raises AccuracyError where the samples do not resolve the window; DeviceError where no device works.
        """
        return Reference(self.field, self.sigma_um, self.config.light.lambda_min_nm, progress)


@dataclass(frozen=True)
class Bench:
    """The surfaces that all pages measure.

    quick: smaller maps and fewer points, for a first look and for tests. runs: methods applied to Elaphe, by name,
    which several pages show (pipeline.evaluation.figures.method_runs).
    """

    blazed: BenchSurface
    elaphe: BenchSurface
    xenopeltis: BenchSurface
    quick: bool
    runs: "dict[str, Run]" = field(default_factory=dict, init=False, repr=False, compare=False)
