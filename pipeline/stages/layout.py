"""The part of a table layout in the stages."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipeline.accuracy.convergence import CoarseMap, Study
from pipeline.config.models import Config
from pipeline.stages.foreseen import Foreseen, LayoutSizes
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import Evaluator, Table

if TYPE_CHECKING:
    from pipeline.bundle.prepared import Prepared


@dataclass(frozen=True)
class Layout:
    """The stages of a layout, and the functions that the other stages need of it.

    transform: the stage that transforms the surface. table: the stage that integrates the transform to a table.
    textures: the stage that stores the table as a bundle holds it, in few textures or half floats.
    load: reads the table of an artifact. table_of: returns the table of a stage's inputs, from memory if it is there.
    stored_of: returns the table that the bundle's textures hold.
    size: describes the size of the table, for a plan.
    study: returns the curves of error against each setting that `validate` shows, from config, inputs, the table's
        evaluator and the map on which errors are measured. study_remark: a sentence on them for the report.
    sizes: computes memory and time of the layout's stages before they begin.
    settings: returns rows (name, value) for the report, from the summaries of the transform and of the table.
    prepare: makes the table's part of a bundle.
    """

    transform: Stage
    table: Stage
    textures: Stage
    load: Callable[[Artifact], Table]
    table_of: Callable[[Inputs], Table]
    stored_of: Callable[[Inputs], Table]
    size: Callable[[Config], str]
    study: Callable[[Config, Inputs, Evaluator, CoarseMap], Study]
    study_remark: str
    sizes: Callable[[Foreseen], LayoutSizes]
    settings: Callable[[Summary, Summary], list[list[str]]]
    prepare: "Callable[[Config, Inputs], Prepared]"
