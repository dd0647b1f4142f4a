"""A height field that looks the same under no flip or turn, for files of many formats."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.surface.readers import read_scan
from pipeline.surface.scan import Scan

NY, NX = 10, 12
# top row first; nothing looks the same when it is flipped or turned
TOP_FIRST = np.arange(1.0, 121.0).reshape(NY, NX)
VOID = (2, 3)
PITCH_UM = (0.1, 0.2)


def with_void(value: float, dtype: str) -> NDArray[Any]:
    stored = TOP_FIRST.astype(dtype)
    stored[VOID] = value
    return stored


def padded(text: str, length: int) -> bytes:
    return text.encode().ljust(length, b"\0")[:length]


def packed(members: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for member, data in members.items():
            archive.writestr(member, data)
    return file.getvalue()


def check(scan: Scan, void: bool, um: float, pitch: tuple[float, float]) -> None:
    """The heights of TOP_FIRST in units of `um` micrometres, with the void as a hole."""
    assert scan.um_per_unit is not None
    expected = (with_void(np.nan, "f8") if void else TOP_FIRST)[::-1] * um
    # a constant height changes nothing
    found = scan.heights * scan.um_per_unit
    np.testing.assert_allclose(found - np.nanmin(found), expected - np.nanmin(expected), rtol=2e-5, atol=1e-9)
    assert scan.pitch_um == pytest.approx(pitch, rel=1e-5)


def check_cut(path: Path, data: bytes, kept: float) -> None:
    """A file of which only a share is kept is refused in one line that begins with its name."""
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(InputError) as caught:
        read_scan(path, None)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{path.name}: expected ")
