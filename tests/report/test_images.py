"""Pictures: numbers in EXR, pixels in PNG, the right way up."""

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from pipeline.errors import StorageError
from pipeline.report.images import read_xyz, write_png, write_xyz

# 5 columns and 3 rows, every number another
RAMP = np.arange(45.0).reshape(3, 5, 3)


@settings(max_examples=30, deadline=None)
@given(
    image=hnp.array_shapes(min_dims=2, max_dims=2, max_side=20).flatmap(
        lambda shape: hnp.arrays(np.float32, (*shape, 3), elements=st.floats(width=32, allow_nan=False))
    )
)
def test_exr_round_trip(tmp_path_factory, image):
    """float32 numbers of any size come back bit for bit, rows as rows."""
    path = tmp_path_factory.getbasetemp() / "image.exr"
    write_xyz(path, image)
    found = read_xyz(path)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, image)


def test_exr_channels_are_named_for_what_they_are(tmp_path):
    """Channels brdf.X, brdf.Y, brdf.Z, as any other reader finds them, in linear XYZ under D65."""
    write_xyz(tmp_path / "a.exr", RAMP)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        assert set(channels) == {"brdf.X", "brdf.Y", "brdf.Z"}
        assert header["colorInteropID"] == "lin_ciexyzd65_scene"
        for c, name in enumerate("XYZ"):
            np.testing.assert_array_equal(channels[f"brdf.{name}"].pixels, RAMP[..., c])


def test_exr_is_wide_where_the_image_is(tmp_path):
    """Five columns and three rows are a window 5 wide and 3 high, its first row on top."""
    write_xyz(tmp_path / "a.exr", RAMP)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        header = file.header()
        first, last = header["dataWindow"]
        assert (np.asarray(last) - first + 1).tolist() == [5, 3]
        assert header["lineOrder"] == OpenEXR.INCREASING_Y
        assert file.channels()["brdf.X"].pixels[0, 0] == RAMP[0, 0, 0]


def test_exr_takes_views_of_arrays(tmp_path):
    """An image turned upside down without a copy is written as it looks."""
    write_xyz(tmp_path / "a.exr", RAMP[::-1])
    np.testing.assert_array_equal(read_xyz(tmp_path / "a.exr"), RAMP[::-1])


def test_exr_that_cannot_be_written_is_a_storage_fault(tmp_path):
    """OpenEXR's own error becomes one that names the file."""
    with pytest.raises(StorageError, match="nowhere"):
        write_xyz(tmp_path / "nowhere" / "a.exr", RAMP)


def test_png_round_trip(tmp_path):
    """Pixels come back, five wide and three high, first row on top, red first."""
    pixels = (5 * RAMP).astype(np.uint8)
    write_png(tmp_path / "a.png", pixels)
    with Image.open(tmp_path / "a.png") as image:
        assert (image.size, image.mode) == ((5, 3), "RGB")
        np.testing.assert_array_equal(np.asarray(image), pixels)
