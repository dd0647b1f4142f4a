"""Formats that are containers of other files, written by the tests from their layouts: orientation, units, voids."""

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.surface.readers import read_scan
from tests.surface.asymmetric import NX, NY, PITCH_UM, TOP_FIRST, check, packed

pytestmark = pytest.mark.usefixtures("surface_topography")

DASHES = "-" * 42


def nmm() -> bytes:
    """A nano measuring machine's scan: a description, and a table for each line, whose Ly grows from line to line."""
    pitch_x, pitch_y = PITCH_UM
    field = {"Number of scans": "1", "Number of lines": str(NY)}
    field |= {"Scan line length": f"{pitch_x * (NX - 1)} [um]", "Scan field width": f"{pitch_y * (NY - 1)} [um]"}
    field |= {"Distance beetween points": f"{pitch_x} [um]", "Distance beetween lines": f"{pitch_y} [um]"}
    lines = [DASHES, "Scan procedure description file", "Creation time : 2020-01-01", DASHES, "3. Scan field"]
    members = {"a.dsc": "\n".join([*lines, *(f"{key} : {value}" for key, value in field.items()), DASHES])}
    for line, heights in enumerate(TOP_FIRST[::-1]):
        columns = ("Lx", "Ly", "-Lz+Az")
        told = [f"{i} : 2020-01-01 : {name} : {NX} : {name}" for i, name in enumerate(columns)]
        members[f"a_1_{line + 1}.dsc"] = "\n".join([DASHES, *told, DASHES])
        rows = [f"{1e-6 * pitch_x * i} {1e-6 * pitch_y * line} {1e-9 * h}" for i, h in enumerate(heights)]
        members[f"a_1_{line + 1}.dat"] = "\n".join(rows)
    return packed({name: text.encode() for name, text in members.items()})


# name -> (content, void, micrometres per unit of TOP_FIRST)
FILES: dict[str, tuple[Callable[[], bytes], bool, float]] = {
    "a.zip": (nmm, False, 1e-3),
}


@pytest.mark.parametrize("name", FILES)
def test_file(tmp_path: Path, name: str) -> None:
    make, void, um = FILES[name]
    (tmp_path / name).write_bytes(make())
    check(read_scan(tmp_path / name, None), void, um, PITCH_UM)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kept", [0.97, 0.5])
def test_a_cut_file_is_one_line(tmp_path: Path, name: str, kept: float) -> None:
    data = FILES[name][0]()
    (tmp_path / name).write_bytes(data[: int(kept * len(data))])
    with pytest.raises(InputError) as caught:
        read_scan(tmp_path / name, None)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{name}: expected ")
