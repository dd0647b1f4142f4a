"""The registry of table layouts: all that is known of a layout outside its own folders.

A layout has a folder in each room that needs one, whose modules are loaded on demand, by the names that this registry
gives: `layout.py` of its stages, and `layout.py`, `look_up.py` and `templates/layout.md.in` of its part of a bundle.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

from numpy.typing import NDArray
from pydantic import BeforeValidator, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.settings import LayoutSettings
from pipeline.tables.taylor.layout import TaylorLayout

if TYPE_CHECKING:
    from pipeline.bundle.layout import BundleLayout
    from pipeline.stages.layout import Layout


@dataclass(frozen=True)
class Registered:
    """The parts of a layout: the class of its [table], and the packages of its stages and of its part of a bundle."""

    settings: type[LayoutSettings]
    stages: str
    bundle: str


# by name; the first is that of a config which names none
LAYOUTS = {
    "polar": Registered(PolarLayout, stages="pipeline.stages.polar", bundle="pipeline.bundle.polar"),
    "taylor": Registered(TaylorLayout, stages="pipeline.stages.taylor", bundle="pipeline.bundle.taylor"),
}


def of(table: LayoutSettings) -> "Layout":
    """Returns the stages of a layout, for a config's section [table]."""
    found: Layout = import_module(f"{LAYOUTS[table.layout].stages}.layout").LAYOUT
    return found


def bundled(name: str) -> "BundleLayout":
    """Returns the part of a bundle of the layout of this name."""
    found: BundleLayout = import_module(f"{LAYOUTS[name].bundle}.layout").LAYOUT
    return found


def textures(grid: dict[str, Any], planes: list[NDArray[Any]], scale: list[Any]) -> Any:
    """Makes the look-up in the textures of a bundle, by `textures` of the layout's own look_up.py.

    grid: from the manifest. planes: pixels (rows, columns, RGBA) of each image. scale: from each image's entry.
    """
    return import_module(f"{LAYOUTS[grid['layout']].bundle}.look_up").textures(grid, planes, scale)


def default() -> LayoutSettings:
    """Returns the section [table] of a config that has none."""
    name, layout = next(iter(LAYOUTS.items()))
    return layout.settings(layout=name)


@dataclass(frozen=True)
class OneOf:
    """Annotates a field with the union of a class of every layout; the key "layout" says which of them a value is.

    of: returns the class of the layout of a name.
    """

    of: Callable[[str], type]

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Makes the schema that pydantic asks for, when the class with the field is defined."""
        schemas = {name: handler.generate_schema(self.of(name)) for name in LAYOUTS}
        return core_schema.tagged_union_schema(schemas, discriminator="layout")


def _default_layout(table: Any) -> Any:
    """Adds the default layout to a section [table] that names none."""
    return {"layout": next(iter(LAYOUTS)), **table} if isinstance(table, dict) else table


TableSettings = Annotated[
    LayoutSettings, OneOf(lambda name: LAYOUTS[name].settings), BeforeValidator(_default_layout)
]
