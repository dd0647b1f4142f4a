"""The stages from a measured height field to tables of its diffraction, and the physics that they share.

    from pipeline import Bundle, bake, load_scan

is the public API (pipeline/api.py). It is imported when one of its names is first used, because other modules of the
package must import fast.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.api import Baked, Bundle, bake, load_scan

__all__ = ["Baked", "Bundle", "bake", "load_scan"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'pipeline' has no attribute {name!r}")
    from pipeline import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
