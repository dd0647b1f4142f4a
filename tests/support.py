"""What tests share: where real scans are, and fields made of them."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.surface.conditioning import condition
from pipeline.surface.heightfield import HeightField

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def shared_file(name: str) -> Path:
    """A real scan from beside the checkout, or a skip that says so."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"real scan {name} is not beside this checkout")
    return path


def snake(name: str) -> HeightField:
    """A real snake scan (65 um, levelled and clipped as [D14] 6.3's sigma_h says): "elaphe" or "xenopeltis"."""
    from PIL import Image

    height_range = {"elaphe": 0.518, "xenopeltis": 0.81869}[name]
    with Image.open(shared_file(f"snakes/{name}_65um.png")) as image:
        codes = np.asarray(image.convert("RGB"))[::-1, :, 0]
    field = HeightField(codes / 255.0 * height_range, (65.0 / codes.shape[1], 65.0 / codes.shape[0]))
    return condition(field, "plane", (0.05, 99.9))[0]
