"""Objects that the stages of one run share in memory, because reading them from disk takes longer than using them."""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

# a larger object is released after the stage that asks for it first, to leave its memory to the following stages
_KEPT_BYTES = 2**28


def kept_bytes(nbytes: int) -> int:
    """Returns how much of an object of this size a session holds between stages: all or nothing."""
    return nbytes if nbytes <= _KEPT_BYTES else 0


class Sized(Protocol):
    """An object with a size in memory."""

    @property
    def nbytes(self) -> int:
        """Size of its arrays, bytes."""


T = TypeVar("T", bound=Sized)


class Session:
    """The objects of one run of one config, by name."""

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {}

    def keep(self, name: str, value: Sized) -> None:
        """Keeps an object under a name, for the following stages."""
        self._objects[name] = value

    def get(self, name: str, make: Callable[[], T]) -> T:
        """Returns the object of a name, or makes it; an object above 256 MiB is not kept for the next call."""
        value: T = self._objects.pop(name) if name in self._objects else make()
        if value.nbytes <= _KEPT_BYTES:
            self._objects[name] = value
        return value
