"""colour-science's tables: the library's own, from it or from the cache, whatever became of the cache."""

from pathlib import Path

import colour
import numpy as np
import platformdirs
import pytest

from pipeline.optics import colour_data

OBSERVER = "CIE 1931 2 Degree Standard Observer"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and nothing remembered of another."""
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda _name: str(tmp_path / "cache"))
    _forget()
    yield tmp_path / "cache"
    _forget()


def _forget() -> None:
    colour_data.srgb.cache_clear()
    colour_data._spectral.cache_clear()


def _hold_all() -> None:
    """The three kinds of tables against the library."""
    nodes, power = colour_data.illuminant("D65")
    np.testing.assert_array_equal(nodes, colour.SDS_ILLUMINANTS["D65"].wavelengths)
    np.testing.assert_array_equal(power, colour.SDS_ILLUMINANTS["D65"].values)
    nodes, values = colour_data.observer(OBSERVER)
    np.testing.assert_array_equal(nodes, colour.MSDS_CMFS[OBSERVER].wavelengths)
    np.testing.assert_array_equal(values, colour.MSDS_CMFS[OBSERVER].values)
    space = colour.RGB_COLOURSPACES["sRGB"]
    np.testing.assert_array_equal(colour_data.srgb().to_xyz, space.matrix_RGB_to_XYZ)
    np.testing.assert_array_equal(colour_data.srgb().from_xyz, space.matrix_XYZ_to_RGB)
    np.testing.assert_allclose(colour_data.srgb().white, colour.xy_to_XYZ(space.whitepoint), rtol=1e-15)


def test_tables_are_the_librarys_and_are_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _hold_all()
    kept = sorted(folder.rglob("*"))
    assert [path.suffix for path in kept if path.is_file()] == [".npz"] * 3
    _forget()
    # what is kept is read again without the library
    monkeypatch.setattr(colour, "SDS_ILLUMINANTS", {})
    nodes, power = colour_data.illuminant("D65")
    assert (len(nodes), power[nodes == 560.0]) == (len(power), 100.0)


def test_a_damaged_cache_is_made_again(folder: Path) -> None:
    _hold_all()
    for path in folder.rglob("*.npz"):
        path.write_bytes(path.read_bytes()[:-40])
    _forget()
    _hold_all()


def test_a_cache_that_cannot_be_written_is_done_without(folder: Path) -> None:
    folder.write_text("a file where the folder would be", encoding="utf-8")
    _hold_all()
