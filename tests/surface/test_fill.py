"""Filling of many holes: the direct solution of Laplace's equation, at a cost linear in samples."""

import time
import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from pipeline.surface import fill
from pipeline.surface.fill import fill_holes

Mask = NDArray[np.bool_]


def rough(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Correlated noise with a tilt and an offset, so that fillings are no constants."""
    heights = gaussian_filter(np.random.default_rng(0).standard_normal(shape), 2)
    return heights + 5 + np.linspace(0, 1, shape[1]) + np.linspace(0, 2, shape[0])[:, None]


def unmeasured(kind: str, shape: tuple[int, int]) -> Mask:
    """Returns the valid samples of a scan with holes of a kind."""
    rng = np.random.default_rng(1)
    valid = np.ones(shape, bool)
    ny, nx = shape
    if kind == "rows at an edge":
        valid[int(0.6 * ny) :] = False
    elif kind == "block":
        valid[ny // 5 : 4 * ny // 5, nx // 6 : 5 * nx // 6] = False
    elif kind == "frame":
        valid[:] = False
        valid[ny // 4 : 3 * ny // 4, nx // 4 : 3 * nx // 4] = True
    elif kind == "one valid sample":
        valid[:] = False
        valid[ny // 3, nx // 2] = True
    elif kind == "blobs":
        waves = gaussian_filter(rng.standard_normal(shape), ny / 40)
        valid = waves < np.quantile(waves, 0.6)
    elif kind == "lines":
        valid[np.arange(ny) % 7 < 3] = False
    else:
        valid = rng.random(shape) >= float(kind)
    return valid


KINDS = ("rows at an edge", "block", "frame", "one valid sample", "blobs", "lines", "0.1", "0.4", "0.9", "0.99")


@pytest.mark.parametrize("pitch", [(0.1, 0.1), (0.1, 0.35), (2.0, 0.1)])
@pytest.mark.parametrize("kind", KINDS)
def test_many_holes_are_filled_as_a_direct_solver_does(
    kind: str, pitch: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    for shape in ((119, 90), (64, 201)):
        heights, valid = rough(shape), unmeasured(kind, shape)
        expected = fill_holes(np.where(valid, heights, np.nan), valid, pitch)
        monkeypatch.setattr(fill, "_FEW_HOLES", 0)
        filled = fill_holes(np.where(valid, heights, np.nan), valid, pitch)
        monkeypatch.undo()
        np.testing.assert_array_equal(filled[valid], heights[valid])
        np.testing.assert_allclose(filled, expected, rtol=0, atol=1e-6 * np.ptp(heights))
        assert heights[valid].min() <= filled.min()
        assert filled.max() <= heights[valid].max()


def test_a_flat_scan_is_filled_flat(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fill, "_FEW_HOLES", 0)
    valid = unmeasured("block", (40, 50))
    np.testing.assert_array_equal(fill_holes(np.where(valid, 0.3, np.nan), valid, (0.1, 0.1)), 0.3)


def test_no_holes_change_nothing() -> None:
    heights = rough((20, 30))
    np.testing.assert_array_equal(fill_holes(heights, np.ones(heights.shape, bool), (0.1, 0.1)), heights)


def _cost(side: int, kind: str) -> tuple[float, float]:
    """Measures the filling of a square scan: CPU seconds, and peak bytes of memory beyond the scan itself."""
    shape = (side, side)
    heights, valid = np.random.default_rng(2).standard_normal(shape), unmeasured(kind, shape)
    heights[~valid] = np.nan
    start = time.process_time()
    fill_holes(heights, valid, (0.1, 0.1))
    seconds = time.process_time() - start
    tracemalloc.start()
    fill_holes(heights, valid, (0.1, 0.1))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return seconds, float(peak)


@pytest.mark.parametrize("kind", ["block", "0.4"])
def test_cost_is_linear_in_samples(kind: str) -> None:
    small, large = _cost(256, kind), _cost(512, kind)
    # four times the samples; the direct solver needs six to seven times as long
    assert large[1] < 4.6 * small[1]
    # 74 bytes for each sample, with the filled copy
    assert large[1] < 80 * 512**2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["block", "blobs", "0.4"])
def test_a_scan_of_2048_lines(kind: str) -> None:
    seconds, peak = _cost(2048, kind)
    # 2 to 6 s on the processors of two servers
    assert seconds < 10.0
    # the scan itself takes 34 MB
    assert peak < 0.5e9
