"""The registry of table layouts: the classes of [table], and the stages of each, which are loaded on demand."""

from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field

from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.taylor.layout import TaylorLayout

if TYPE_CHECKING:
    from pipeline.stages.layout import Layout

_STAGES: dict[type, str] = {
    PolarLayout: "pipeline.stages.polar.layout",
    TaylorLayout: "pipeline.stages.taylor.layout",
}
NAMES = ("polar", "taylor")


def _default_layout(table: Any) -> Any:
    """Adds the layout "polar" to a section [table] that names none."""
    return {"layout": "polar", **table} if isinstance(table, dict) else table


TableSettings = Annotated[
    Annotated[PolarLayout | TaylorLayout, Field(discriminator="layout")], BeforeValidator(_default_layout)
]


def of(table: PolarLayout | TaylorLayout) -> "Layout":
    """Returns the stages of a layout, for a config's section [table]."""
    found: Layout = import_module(_STAGES[type(table)]).LAYOUT
    return found
