"""One page of the validation bench: checks, tables of typed columns and pictures; and the surfaces it is made of."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.evaluation import results
from pipeline.evaluation.check import Check
from pipeline.evaluation.plots.charts import Chart, Series
from pipeline.evaluation.texts import Texts
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField

if TYPE_CHECKING:
    from pipeline.evaluation.figures.maps import Run

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
        return [dict(zip(self.headings, results.plain(list(row)), strict=True)) for row in self.rows]


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
        checks = [replace(check, source=check.source or self.source) for check in self.checks]
        tables = {table.id: table.records for table in self.tables}
        words = {"name": self.name, "title": self.title, "source": self.source}
        return {**words, "checks": results.plain(checks), "tables": tables}


class PageText(Texts):
    """The words of a page, figures/texts/NAME.toml, put together with what its module computes."""

    def __init__(self, name: str, **values: Any) -> None:
        super().__init__("pipeline.evaluation.figures", name, **values)
        self._name = name

    def columns(self, key: str, /, **values: Any) -> list[Column]:
        """Return the columns of [tables.KEY]: each is a name, or a list of a format and the names that have it."""
        entries = self.words["tables"][key]["columns"]
        formed = [("{}", [each]) if isinstance(each, str) else (each[0], each[1:]) for each in entries]
        return [Column(self.fill(name, **values), form) for form, names in formed for name in names]

    def table(
        self, key: str, rows: Iterable[Sequence[Cell]], more: Sequence[Column] = (), /, **values: Any
    ) -> PageTable:
        """Return [tables.KEY] with its rows. more: columns that follow those of the file."""
        caption = self.fill(self.words["tables"][key]["caption"], **values)
        return PageTable(values.get("id", key), caption, [*self.columns(key, **values), *more], list(rows))

    def picture(self, key: str, png: bytes, /, **values: Any) -> Picture:
        """Return a picture with its caption of [pictures]."""
        return Picture(png, self.fill(self.words["pictures"][key], **values))

    def chart(self, key: str, series: Sequence[Series], /, **known: Any) -> Chart:
        """Return [charts.KEY] with its curves. known: values of its texts, and computed fields of `Chart`."""
        return self.filled(Chart, self.words["charts"][key], known, series=series)

    def remark(self, key: str, /, **values: Any) -> str:
        """Return a text of [remarks]."""
        return self.fill(self.words["remarks"][key], **values)

    def page(
        self,
        checks: Iterable[Check],
        tables: Sequence[PageTable],
        pictures: Sequence[Picture],
        remarks: Sequence[str] | None = None,
    ) -> Page:
        """Return the page. remarks: None for all of the file."""
        title, source, expected = (self.fill(self.words[name]) for name in ("title", "source", "expected"))
        explained = [self.remark(key) for key in self.words["remarks"]] if remarks is None else remarks
        return Page(self._name, title, source, expected, list(checks), tables, pictures, explained)


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
    which several pages show (pipeline.evaluation.figures.maps).
    """

    blazed: BenchSurface
    elaphe: BenchSurface
    xenopeltis: BenchSurface
    quick: bool
    runs: "dict[str, Run]" = field(default_factory=dict, init=False, repr=False, compare=False)
