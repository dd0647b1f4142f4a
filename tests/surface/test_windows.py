"""Positions of the coherence window on a scan that is larger than the window."""

import numpy as np
import pytest

from pipeline.optics.coherence import Coherence
from pipeline.surface import windows
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField

pytestmark = pytest.mark.physics

SIGMA = 1.5


def rough(nx: int, ny: int) -> HeightField:
    """White noise on `nx` x `ny` samples."""
    return HeightField(np.random.default_rng(1).uniform(-0.08, 0.08, (ny, nx)), (0.1, 0.1))


@pytest.mark.parametrize(
    ("nx", "ny", "expected"), [(60, 60, 1), (89, 60, 1), (91, 60, 2), (91, 120, 6), (120, 120, 9), (400, 60, 3)]
)
def test_windows_are_half_a_width_apart_and_at_most_three_per_axis(nx: int, ny: int, expected: int) -> None:
    extent = Extent((ny, nx), (0.1, 0.1), 0.1)
    assert windows.places(extent, Coherence(sigma_um=SIGMA)).count == expected
    assert windows.places(extent, Coherence(sigma_um=SIGMA, windows="centre")) == windows.MIDDLE


def test_each_window_is_shifted_to_the_middle_and_crosses_no_edge() -> None:
    """A mark on the heights shifts with the window."""
    field = rough(120, 90)
    heights = field.heights_um.copy()
    heights[45 + 15, 60 - 30] = 9.0
    marked = HeightField(heights, field.pitch_um)
    places = windows.places(field.extent, Coherence(sigma_um=SIGMA)).pairs()
    assert (0, 15) in places
    parts = {place: windows.around(marked, place, field.shape) for place in places}
    np.testing.assert_array_equal(parts[0, 15].heights_um, np.roll(heights, (-15, 0), axis=(0, 1)))
    found = {tuple(int(i) for i in np.argwhere(part.heights_um == 9.0)[0]) for part in parts.values()}
    # centres at y = -+1.5 um, x = -3, 0, 3 um: at least half a width from the edges
    assert found == {(60 + dy, 30 + dx) for dy in (15, -15) for dx in (-30, 0, 30)}
    small = windows.around(marked, (30, -15), (41, 50)).heights_um
    np.testing.assert_array_equal(small, parts[30, -15].heights_um[45 - 20 : 45 + 21, 60 - 25 : 60 + 25])
