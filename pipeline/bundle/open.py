"""A bundle as a source of light, once it is known to be unharmed."""

from pathlib import Path

from pipeline.bundle.evaluate import Bundle
from pipeline.bundle.verify import summary, verify
from pipeline.errors import DamagedError
from pipeline.tables.evaluate import Evaluator


def bundle_evaluator(folder: Path) -> Evaluator:
    """XYZ from a bundle's own tables and numbers. Raises DamagedError where the bundle has faults."""
    return open_bundle(folder).xyz


def open_bundle(folder: Path) -> Bundle:
    """A bundle in memory. Raises DamagedError where it has faults.

    The code that runs is this project's evaluate.py, never the bundle's copy.
    """
    faults = verify(folder)
    if faults:
        raise DamagedError(f"{folder}: {summary(faults)}. Fetch the bundle again, or publish it again")
    return Bundle(folder)
