"""Objects that the stages of one run hand on in memory, since reading them back takes longer than using them."""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

# what is larger serves the stage that asks for it first, and then leaves its memory to the stages that follow
_KEPT_BYTES = 2**28


class Sized(Protocol):
    """An object that knows its size."""

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""


T = TypeVar("T", bound=Sized)


class Session:
    """The objects of one run of one config, by name."""

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {}

    def keep(self, name: str, value: Sized) -> None:
        """Hands an object on to the stages that follow."""
        self._objects[name] = value

    def get(self, name: str, make: Callable[[], T]) -> T:
        """The object of a name, which is made where none is kept."""
        value: T = self._objects.pop(name) if name in self._objects else make()
        if value.nbytes <= _KEPT_BYTES:
            self._objects[name] = value
        return value
