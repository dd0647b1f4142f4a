"""All that the stages know of one table layout."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipeline.accuracy.convergence import CoarseMap, Study
from pipeline.config.models import Config
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import Evaluator, Table

if TYPE_CHECKING:
    from pipeline.bundle.prepared import Prepared


@dataclass(frozen=True)
class Layout:
    """The stages of a layout and what the stages after them need of it.

    transform, table: the stage that transforms the surface, and the stage that makes the table of it.
    load: the table of an artifact. size: the table's size in words, for a plan.
    study: the settings whose influence on the error `validate` shows, and a remark on them for the report.
    settings: rows (name, value) of the report on what the table is made of, from the summaries of both stages.
    prepare: the table's part of a bundle; raises AccuracyError where what is stored would miss a budget.
    """

    transform: Stage
    table: Stage
    load: Callable[[Artifact], Table]
    size: Callable[[Config], str]
    study: Callable[[Config, Inputs, Evaluator, CoarseMap], Study]
    study_remark: str
    settings: Callable[[Summary, Summary], list[list[str]]]
    prepare: "Callable[[Config, Inputs], Prepared]"
