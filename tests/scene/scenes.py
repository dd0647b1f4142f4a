"""Scenes of the tests, and files that they name."""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Array
from pipeline.report import images
from pipeline.scene.model import Scene

ROWS = 64


def scene(**keys: Any) -> Scene:
    """A valid [scene]."""
    return Scene.model_validate(keys)


def latlong(rows: int = ROWS) -> Array:
    """A grey sky over a dark ground, and a lamp of four pixels at 45 degrees in +y: its luminances."""
    sky = np.where(np.arange(rows)[:, None] < rows // 2, 1.0, 0.25) * np.ones(2 * rows)
    # longitude 90 degrees is a quarter from the left edge
    sky[rows // 4 - 1 : rows // 4 + 1, rows // 2 - 1 : rows // 2 + 1] = 1000.0
    return sky


def write_environment(path: Path, luminance: Array, names: str = "RGB") -> str:
    """Writes luminances (rows, columns) as an EXR of grey light; returns its name."""
    images.write_exr(path, {name: luminance.astype(np.float32) for name in names}, "lin_rec709_scene")
    return str(path)
