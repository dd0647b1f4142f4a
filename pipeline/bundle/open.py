"""A bundle as a source of light: for `diffract-bake eval BUNDLE`."""

from pathlib import Path

from pipeline.bundle.evaluate import Bundle
from pipeline.bundle.verify import summary, verify
from pipeline.errors import DamagedError
from pipeline.tables.evaluate import Evaluator


def bundle_evaluator(folder: Path) -> Evaluator:
    """XYZ from a bundle's own tables and numbers. Raises DamagedError where the bundle has faults.

    The code that runs is this project's evaluate.py, never the bundle's copy.
    """
    faults = verify(folder)
    if faults:
        raise DamagedError(f"{folder}: {summary(faults)}. Fetch the bundle again, or publish it again")
    return Bundle(folder).xyz
