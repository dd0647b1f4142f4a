"""Objects that stages share in memory, because reading them from disk takes longer than using them."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from pipeline.config.models import Config

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
V = TypeVar("V")


@dataclass(frozen=True)
class Small(Generic[V]):
    """A value whose memory is not worth counting."""

    value: V
    nbytes: int = 0


class Session:
    """The objects of a run, each by the address of the artifact that holds it, so that configs can share them.

    following: configs that are to be baked after the present one, of the same transform of the same surface.
    """

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {}
        self._derived: dict[str, Any] = {}
        self.following: Sequence[Config] = ()

    def keep(self, address: str, value: Sized) -> None:
        """Keeps the object of an artifact, for the following stages."""
        self._objects[address] = value

    def get(self, address: str, make: Callable[[], T]) -> T:
        """Returns the object of an artifact, or makes it; an object above 256 MiB is not kept for the next call."""
        return _taken(self._objects, address, make)

    def derived(self, name: str, make: Callable[[], T]) -> T:
        """Returns an object that is in no artifact, or makes it; `name` holds the addresses of what it is made of."""
        return _taken(self._derived, name, make)

    @property
    def derived_bytes(self) -> int:
        """Size of the objects that are in no artifact, bytes."""
        return sum(value.nbytes for value in self._derived.values())

    def retain(self, addresses: Collection[str], *, derived: bool) -> None:
        """Drops all objects but those of some artifacts; `derived`: whether to keep those that are in none."""
        self._objects = {address: value for address, value in self._objects.items() if address in addresses}
        if not derived:
            self.drop_derived()

    def drop_derived(self) -> None:
        """Drops the objects that are in no artifact."""
        self._derived = {}


def _taken(objects: dict[str, Any], name: str, make: Callable[[], T]) -> T:
    """Returns an object, which stays among the others where it is small enough."""
    value: T = objects.pop(name) if name in objects else make()
    if value.nbytes <= _KEPT_BYTES:
        objects[name] = value
    return value
