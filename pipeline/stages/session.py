"""Objects that stages share in memory, because reading them from disk takes longer than using them."""

from collections.abc import Callable, Collection
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
    """The objects of a run, each by the address of the artifact that holds it, so that configs can share them."""

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {}

    def keep(self, address: str, value: Sized) -> None:
        """Keeps the object of an artifact, for the following stages."""
        self._objects[address] = value

    def get(self, address: str, make: Callable[[], T]) -> T:
        """Returns the object of an artifact, or makes it; an object above 256 MiB is not kept for the next call."""
        value: T = self._objects.pop(address) if address in self._objects else make()
        if value.nbytes <= _KEPT_BYTES:
            self._objects[address] = value
        return value

    def retain(self, addresses: Collection[str]) -> None:
        """Drops all objects but those of some artifacts."""
        self._objects = {address: value for address, value in self._objects.items() if address in addresses}
