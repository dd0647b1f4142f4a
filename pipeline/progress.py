"""How stages tell how far they are, without knowing who listens."""

from typing import Protocol


class Progress(Protocol):
    """Called with a step's name and the share of it that is done, 0 to 1."""

    def __call__(self, step: str, done: float) -> None: ...


def silent(step: str, done: float) -> None:
    """Nobody listens."""
