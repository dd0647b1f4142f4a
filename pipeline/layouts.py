"""The registry of table layouts: the settings that a config may give, and the stages of each, loaded on demand."""

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
    """A [table] that names no layout is polar."""
    return {"layout": "polar", **table} if isinstance(table, dict) else table


TableSettings = Annotated[
    Annotated[PolarLayout | TaylorLayout, Field(discriminator="layout")], BeforeValidator(_default_layout)
]


def of(table: PolarLayout | TaylorLayout) -> "Layout":
    """The stages of a table's layout."""
    found: Layout = import_module(_STAGES[type(table)]).LAYOUT
    return found
