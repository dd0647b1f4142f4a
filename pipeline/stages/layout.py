"""The part of a table layout in the stages."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.accuracy.convergence import CoarseMap, Study
from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.tiles import Tiles
from pipeline.stages.foreseen import Foreseen, LayoutSizes, WayOut
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.store.store import Artifact
from pipeline.tables.evaluate import Evaluator, Table

if TYPE_CHECKING:
    from pipeline.bundle.layout import Prepared


@dataclass(frozen=True)
class Layout:
    """The stages of a layout, and the functions that the other stages need of it.

    transform: the stage that transforms the surface. table: the stage that integrates the transform to a table.
    textures: the stage that stores the table as a bundle holds it, in few textures or half floats.
    load: reads the table of an artifact. table_of: returns the table of a stage's inputs, from memory if it is there.
    stored_of: returns the table that the bundle's textures hold.
    study: returns the curves of error against each setting that `validate` shows, from config, inputs, the table's
        evaluator and the map on which errors are measured. studied: returns the config with the light and the
        material under which they are measured, where these are not a config's own and the curves depend on the
        transform alone; else None. study_remark: a sentence on them for the report.
    sizes: computes memory and time of the layout's stages before they begin.
    ways_out: keys of [table] that a refusal of too much work may propose to change.
    settings: returns rows (name, value) for the report, from the summaries of the transform and of the table.
    stored: returns such rows on the textures, from the config and the loss in their summary.
    prepare: makes the table's part of a bundle.
    tiles_of: returns the tiles of the table in (u, v), from its artifact, where it has some.
    at_wavelengths: makes the function (uvw, lambda_nm) -> |P|^2, (n, 3), (L,) -> (n, L), from the transform's
        artifact, for a [table] that holds wavelengths.

    The table's summary holds "wavelengths", "unknown_share" and "skipped_share", as the manifest states them, and its
    "certificate"; that of the textures holds "loss", which is None or the JSON of the layout's entry in the manifest,
    and the "certificate" of what they hold.
    """

    transform: Stage
    table: Stage
    textures: Stage
    load: Callable[[Artifact], Table]
    table_of: Callable[[Inputs], Table]
    stored_of: Callable[[Inputs], Table]
    study: Callable[[Config, Inputs, Evaluator, CoarseMap], Study]
    studied: Callable[[Config], Config] | None
    study_remark: str
    sizes: Callable[[Foreseen], LayoutSizes]
    ways_out: tuple[WayOut, ...]
    settings: Callable[[Summary, Summary], list[list[str]]]
    stored: Callable[[Config, dict[str, Any]], list[list[str]]]
    prepare: "Callable[[Config, Inputs], Prepared]"
    tiles_of: Callable[[Artifact], Tiles] | None = None
    at_wavelengths: Callable[[Artifact], Callable[[Array, Array], Array]] | None = None
