"""The progress callback of long computations."""

from typing import Protocol


class Progress(Protocol):
    """A function that is called with the name of a step and its completed share, 0 to 1."""

    def __call__(self, step: str, done: float) -> None: ...


def silent(step: str, done: float) -> None:
    """Ignores progress: the default callback."""
