"""Samples that were not measured: what is recognised, what is cropped, and what honest scans are never accused of."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from pipeline.config import read
from pipeline.errors import InputError
from pipeline.surface import recipes
from pipeline.surface.holes import Measured, far_apart, measured_part
from pipeline.surface.load import load_scan
from pipeline.surface.no_data import sample, sample_without
from pipeline.surface.readers import read_scan
from pipeline.surface.scan import Scan
from pipeline.surface.source import SurfaceSource
from tests.support import shared_file

Heights = NDArray[np.float64]
CONFIGS = Path(__file__).parents[2] / "configs"
NY, NX = 72, 60


def skin(seed: int = 0, shape: tuple[int, int] = (NY, NX)) -> Heights:
    """A wavy, rough surface of some 50 nm about 0, with noise."""
    rng = np.random.default_rng(seed)
    waves = 40 * np.sin(np.arange(shape[1]) / 3) + 10 * gaussian_filter(rng.standard_normal(shape), 2)
    return np.asarray(waves + 0.5 * rng.standard_normal(shape))


def scan(heights: Any, full_code: float | None = None, mask: Any = None) -> Scan:
    return Scan(np.asarray(heights, np.float64), None, None, full_code, "z", ("z",), "array", "numpy", mask=mask)


def found(measured: Measured) -> list[str]:
    return [entry.found for entry in measured.unmeasured]


# --- numbers -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [-9999.0, 9999.0, -99999.0, -32768.0, 32767.0, 1e10, -1e10, 3.4028235e38, -1.7e38])
@pytest.mark.parametrize("count", [1, 5, 400])
def test_conventional_numbers_are_holes(value: float, count: int) -> None:
    heights = skin()
    places = np.random.default_rng(1).permutation(heights.size)[:count]
    heights.ravel()[places] = value
    measured = measured_part(scan(heights))
    assert found(measured) == ["no-data number"]
    assert measured.unmeasured[0].value == value
    assert measured.holes == measured.unmeasured[0].samples == count
    assert np.isnan(measured.heights.ravel()[places]).all()
    (warning,) = measured.warnings
    assert f"{value:.6g}" in warning
    assert "surface.no_data = []" in warning


@pytest.mark.parametrize("value", [-3000.0, 1000.0, 12345.6])
def test_any_number_far_from_all_heights_is_a_hole_where_many_samples_share_it(value: float) -> None:
    heights = skin()
    heights[20:26, 10:40] = value
    measured = measured_part(scan(heights))
    assert found(measured) == ["no-data number"]
    assert measured.holes == 180
    # in any unit, and beside an offset
    assert measured_part(scan(1e-9 * heights)).holes == 180
    assert measured_part(scan(heights + 1e5)).holes == 180


def test_several_numbers() -> None:
    heights = skin()
    heights[5:9, 5:9] = -9999
    heights[30:34, 30:40] = 1e10
    heights[50, 50:55] = np.nan
    measured = measured_part(scan(heights))
    assert sorted(entry.value or 0.0 for entry in measured.unmeasured) == [-9999, 0, 1e10]
    assert measured.holes == 16 + 40 + 5


def test_a_single_spike_is_dust() -> None:
    heights = skin()
    heights[3, 4] = 5000.0
    assert measured_part(scan(heights)).unmeasured == ()


@pytest.mark.parametrize("value", [0.0, 12.3])
def test_one_value_among_the_heights(value: float) -> None:
    heights = skin()
    heights[10:30, 10:20] = value
    measured = measured_part(scan(heights))
    assert found(measured) == ["one value among heights"]
    assert measured.holes == 200


def test_codes_of_images() -> None:
    codes = np.round(30000 + 100 * skin())
    codes[20:30, 20:30] = 0
    assert found(measured_part(scan(codes, full_code=65535.0))) == ["no-data number"]


def test_named_numbers_and_no_others() -> None:
    heights = skin()
    heights[5, 5:9] = -9999
    heights[50, 5:8] = 7.25
    assert measured_part(scan(heights), no_data=()).unmeasured == ()
    measured = measured_part(scan(heights), no_data=(7.25,))
    assert [(entry.value, entry.samples, entry.stated) for entry in measured.unmeasured] == [(7.25, 3, True)]
    assert measured.warnings == ()


@pytest.mark.parametrize("below", [True, False])
def test_an_extreme_value_too_close_to_the_others_is_told(below: bool) -> None:
    heights = skin()
    level = heights.min() - 0.2 * np.ptp(heights) if below else heights.max() + 0.2 * np.ptp(heights)
    heights[20:30, 20:30] = level
    measured = measured_part(scan(heights))
    assert measured.unmeasured == ()
    assert f"hold one value, {level:.6g}, apart from all others" in measured.warnings[0]
    assert measured_part(scan(heights), no_data=()).warnings == ()


# --- rows --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.05, 0.45, 0.8])
@pytest.mark.parametrize("level", [0.0, -70.0, 3000.0, np.nan])
@pytest.mark.parametrize("edge", ["bottom", "top", "left", "right"])
def test_rows_that_were_never_scanned_are_cropped(share: float, level: float, edge: str) -> None:
    heights = skin()
    turned = heights.T if edge in ("left", "right") else heights
    missing = int(share * len(turned))
    turned[slice(None, missing) if edge in ("bottom", "left") else slice(len(turned) - missing, None)] = level
    measured = measured_part(scan(heights))
    cropped = tuple(missing if edge == side else 0 for side in ("bottom", "top", "left", "right"))
    assert (measured.cropped, measured.holes) == (cropped, 0)
    assert measured.share == missing / len(turned)
    assert np.isfinite(measured.heights).all()
    (warning,) = measured.warnings
    assert f"{missing} {'rows' if edge in ('bottom', 'top') else 'columns'} at the {edge} cropped" in warning


@pytest.mark.parametrize("edge", ["bottom", "top"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_unscanned_rows_from_which_a_plane_was_subtracted(edge: str, dtype: Any) -> None:
    heights = skin() + 500
    heights[slice(None, 30) if edge == "bottom" else slice(NY - 30, None)] = 0
    heights -= 3 * np.arange(NX) - 7 * np.arange(NY)[:, None]
    measured = measured_part(scan(heights.astype(dtype)))
    assert (found(measured), measured.holes) == (["straight rows"], 0)
    assert measured.cropped == ((30, 0, 0, 0) if edge == "bottom" else (0, 30, 0, 0))


@pytest.mark.parametrize("level", [0.0, 3000.0])
def test_the_line_in_which_a_scan_was_stopped(level: float) -> None:
    heights = skin() + 3000 * (level == 0)
    heights[40:] = level
    heights[39, 25:] = level
    measured = measured_part(scan(heights))
    assert measured.cropped == (0, NY - 40, 0, 0)
    assert measured.holes == NX - 25


@pytest.mark.parametrize("repeats", [3, 30])
@pytest.mark.parametrize("bottom", [True, False])
def test_repeats_of_the_last_line_are_cropped(repeats: int, bottom: bool) -> None:
    heights = skin()
    if bottom:
        heights[:repeats] = heights[repeats]
    else:
        heights[-repeats:] = heights[-repeats - 1]
    measured = measured_part(scan(heights))
    assert measured.cropped == ((repeats, 0, 0, 0) if bottom else (0, repeats, 0, 0))
    assert found(measured) == ["repeated rows"]
    np.testing.assert_array_equal(measured.heights, heights[repeats:] if bottom else heights[:-repeats])


@pytest.mark.parametrize("slope", [(0.3, 0.0), (0.3, -0.7)])
def test_repeats_from_which_a_plane_was_subtracted(slope: tuple[float, float]) -> None:
    heights = skin()
    heights[40:] = heights[39]
    heights -= slope[0] * np.arange(NX) + slope[1] * np.arange(NY)[:, None]
    assert found(measured_part(scan(heights))) == ["repeated rows"]
    assert measured_part(scan(heights)).cropped == (0, NY - 40, 0, 0)


def test_rows_of_a_lifted_tip_are_told() -> None:
    heights = skin()
    heights[50:] = 0.01 * np.random.default_rng(2).standard_normal((NY - 50, NX))
    measured = measured_part(scan(heights))
    assert measured.unmeasured == ()
    assert measured.warnings[0].startswith(f"{NY - 50} rows at an edge are far smoother")
    assert measured_part(scan(heights), no_data=()).warnings == ()


def test_a_lost_line_within_the_scan_is_filled() -> None:
    heights = skin()
    heights[30] = 0.0
    measured = measured_part(scan(heights))
    assert (found(measured), measured.holes, measured.cropped) == (["rows of one value"], NX, (0, 0, 0, 0))


def test_unscanned_rows_of_different_values() -> None:
    heights = skin()
    heights[50:] = np.arange(NY - 50)[:, None] * 3.7
    assert measured_part(scan(heights)).cropped == (0, NY - 50, 0, 0)


def test_zeros_of_a_scan_whose_lowest_height_is_zero() -> None:
    heights = skin()
    heights -= heights.min()
    heights[:9] = heights[60:] = 0
    measured = measured_part(scan(heights))
    assert (measured.cropped, measured.holes) == ((9, NY - 60, 0, 0), 0)


def test_quantised_heights_lose_their_unscanned_rows_only() -> None:
    codes = np.round(127 + skin())
    codes[50:] = 127
    measured = measured_part(scan(codes, full_code=255.0))
    assert (measured.cropped, measured.holes) == ((0, NY - 50, 0, 0), 0)


# --- masks -------------------------------------------------------------------------------------------


def test_a_mask() -> None:
    heights, mask = skin(), np.zeros((NY, NX), bool)
    mask[10:20, 10:22] = True
    masked = scan(heights, mask=mask)
    untold = measured_part(masked)
    assert (untold.holes, untold.masked_share) == (0, 120 / heights.size)
    (warning,) = untold.warnings
    assert "2.8 %" in warning
    assert "surface.mask" in warning
    assert measured_part(masked, "ignore").warnings == ()
    holes = measured_part(masked, "holes")
    assert (holes.holes, found(holes)) == (120, ["mask"])
    np.testing.assert_array_equal(np.isnan(holes.heights), mask)
    keep = measured_part(masked, "keep")
    np.testing.assert_array_equal(keep.heights, heights[10:20, 10:22])
    # a mask that covers nothing is not worth a word
    assert measured_part(scan(heights, mask=np.zeros((NY, NX), bool))).warnings == ()


# --- words -------------------------------------------------------------------------------------------


def test_a_warning_from_two_per_cent_on() -> None:
    for holes, warned in ((int(0.019 * NY * NX), 0), (int(0.021 * NY * NX), 1)):
        heights = skin()
        heights.ravel()[np.random.default_rng(0).permutation(heights.size)[:holes]] = np.nan
        measured = measured_part(scan(heights))
        assert measured.holes == holes
        assert len(measured.warnings) == warned
    assert "2.1 % of the scan was not measured" in measured.warnings[0]


def test_two_populations_of_heights() -> None:
    heights = skin() * 1e-3
    heights[30:40] -= 10.0
    warning = far_apart(heights)
    assert warning is not None
    assert "9.91 um apart" in warning
    assert "14 % of the samples" in warning
    # as deep as gratings are
    assert far_apart(heights + 9.0 * (heights < -5)) is None
    assert far_apart(np.full((9, 9), np.nan)) is None


def test_the_record_is_json() -> None:
    heights = skin()
    heights[:9] = -9999
    measured = measured_part(scan(heights))
    assert json.loads(json.dumps([asdict(entry) for entry in measured.unmeasured]))[0]["value"] == -9999


def test_nothing_measured_is_returned_whole() -> None:
    measured = measured_part(scan(np.full((9, 10), np.nan)))
    assert (measured.share, measured.holes, measured.cropped) == (1.0, 90, (0, 0, 0, 0))


# --- honest scans ------------------------------------------------------------------------------------


def _steps(noise: float, quantum: float = 0.0, levels: int = 2, axis: int = 1) -> Heights:
    """A step grating; noise and quantum are in shares of its depth."""
    shape = (NY, NX)
    x = np.moveaxis(np.broadcast_to(np.arange(shape[axis]), (shape[1 - axis], shape[axis])), 1, axis)
    steps = (x // 7) % levels + noise * np.random.default_rng(3).standard_normal(shape)
    return np.asarray(np.round(steps / quantum) * quantum if quantum else steps, np.float64)


def _slow_drift() -> Heights:
    """A grating without noise under a slow drift, in 8 bits: many rows are equal to their neighbours."""
    x, y = np.arange(NX), np.arange(NY)[:, None]
    return np.asarray(np.round(100 + 50 * np.sin(x / 4) + 0.05 * y), np.float64)


HONEST: dict[str, Callable[[], Heights]] = {
    "flat mirror": lambda: np.zeros((NY, NX)),
    "flat mirror with noise": lambda: np.random.default_rng(0).standard_normal((NY, NX)),
    "flat mirror in three codes": lambda: np.round(127 + 0.4 * np.random.default_rng(0).standard_normal((NY, NX))),
    "smooth mirror in a few codes": lambda: np.round(
        127 + 6 * gaussian_filter(np.random.default_rng(0).standard_normal((NY, NX)), 5)
    ),
    "mirror with dust": lambda: np.where(np.random.default_rng(0).random((NY, NX)) < 0.01, 9.0, 0.0),
    "tilted mirror": lambda: 0.3 * np.arange(NX) + 0.1 * np.arange(NY)[:, None],
    "tilted mirror with dust": lambda: 0.3 * np.arange(NX) + (np.random.default_rng(0).random((NY, NX)) < 0.01),
    "tilted mirror with one bump": lambda: (
        np.maximum(0, 100 - np.hypot(*np.mgrid[-36:36, -30:30]) ** 2) + 0.3 * np.arange(NX)
    ),
    "tilted hills": lambda: (
        0.1 * np.arange(NX) + np.maximum(0, gaussian_filter(np.random.default_rng(0).standard_normal((NY, NX)), 3))
    ),
    "parabola": lambda: np.arange(NX) ** 2.0 + np.arange(NY)[:, None] ** 2.0,
    "tilted steps": lambda: _steps(0.0) + 0.01 * np.arange(NX),
    "tilted steps along y": lambda: _steps(0.0, axis=0) + 0.01 * np.arange(NX),
    "mirror with one bump": lambda: np.maximum(0, 100 - np.hypot(*np.mgrid[-36:36, -30:30]) ** 2),
    "hills on a plane": lambda: np.maximum(0, gaussian_filter(np.random.default_rng(0).standard_normal((NY, NX)), 3)),
    "skin": skin,
    "skin in 8 bits": lambda: np.round(127 + skin()),
    "skin in float32": lambda: skin().astype(np.float32).astype(np.float64),
    "skin clipped above": lambda: np.minimum(skin(), 20),
    "skin clipped twice": lambda: np.clip(skin(), -20, 20),
    "tilted and clipped": lambda: np.maximum(skin() + 3 * np.arange(NY)[:, None], 60),
    "tilted, clipped, in 8 bits": lambda: np.clip(np.round(skin() + 5 * np.arange(NY)[:, None]), 0, 255),
    "steps": lambda: _steps(0.0),
    "steps along y": lambda: _steps(0.0, axis=0),
    "steps with noise": lambda: _steps(0.01),
    "steps along y with noise": lambda: _steps(0.01, axis=0),
    "steps in codes": lambda: _steps(0.01, 1 / 200),
    "steps with less noise than a code": lambda: _steps(0.001, 1 / 200),
    "steps clipped at both levels": lambda: np.clip(_steps(0.02), 0, 1),
    "four levels": lambda: _steps(0.0, levels=4),
    "four levels with soft walls": lambda: gaussian_filter(_steps(0.0, levels=4), (0, 0.5)),
    "one step": lambda: np.where(np.arange(NX) < 8, 0.0, 1.0) * np.ones((NY, 1)),
    "one step along y": lambda: np.where(np.arange(NY) < 8, 0.0, 1.0)[:, None] * np.ones(NX),
    "chequers": lambda: (np.arange(NX) // 6 + np.arange(NY)[:, None] // 6) % 2 * 1.0,
    "lines of two lengths": lambda: np.where(np.arange(NY)[:, None] < 60, _steps(0.0), 1 - _steps(0.0)),
    "grating without noise": lambda: np.sin(np.arange(NX) / 3) * np.ones((NY, 1)),
    "grating along y without noise": lambda: np.sin(np.arange(NY) / 3)[:, None] * np.ones(NX),
    "grating with a slow drift, in codes": _slow_drift,
    "blaze": lambda: (np.arange(NX) % 10) * np.ones((NY, 1)),
    "steps of rows": lambda: skin() + np.random.default_rng(0).standard_normal((NY, 1)) * 20,
    "heights of an absolute stage": lambda: 2e6 + skin(),
    "rounded to 0.1": lambda: np.round(skin(), 1),
    "coarse codes": lambda: np.round(skin() / 5) * 5,
}


@pytest.mark.parametrize("name", HONEST)
def test_honest_scans_are_accused_of_nothing(name: str) -> None:
    heights = HONEST[name]()
    for turned in (heights, heights[::-1], heights.T):
        for full_code in (None, 255.0):
            measured = measured_part(scan(turned, full_code))
            assert (measured.unmeasured, measured.warnings) == ((), ())
            np.testing.assert_array_equal(measured.heights, turned)
    assert far_apart(heights * 1e-3) is None


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_recipes_are_accused_of_nothing(path: Path) -> None:
    config = read.load(path)
    if config.surface.recipe is None:
        heights = read_scan(CONFIGS / "example_scan.txt", None).heights
    else:
        heights = recipes.make(config.surface.recipe).heights_um
    codes = np.round(255 * (heights - heights.min()) / (np.ptp(heights) or 1.0))
    for given, full_code in ((heights, None), (heights.T, None), (codes, 255.0), (np.round(1e3 * heights), None)):
        measured = measured_part(scan(given, full_code))
        assert (measured.unmeasured, measured.warnings) == ((), ())
    assert far_apart(heights) is None


REAL = {
    "snakes": ("elaphe_65um.png", "xenopeltis_65um.png", "cd_tracks.png"),
    "scans": (
        *("circles_holes.nid", "squares_holes.nid", "grid.nid", "di-6.di", "example_ps.tiff", "grooves_nm.txt"),
        *("matrix-3.txt", "mi-1.mi", "nanoscope.000", "nanoscope.000.reference.csv", "spot_1-1000nm.ibw"),
        *("stp-1.stp", "top-1.top", "test.gwy"),
    ),
    "field": ("cd_like.npz", "handed_L.gwy", "t_gwy_de.txt"),
}


@pytest.mark.parametrize("name", [f"{folder}/{name}" for folder, names in REAL.items() for name in names])
def test_real_scans_are_accused_of_nothing(name: str) -> None:
    path = shared_file(name)
    if path.suffix in (".nid", ".di", ".tiff", ".mi", ".000", ".ibw", ".stp", ".top", ".gwy"):
        pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    given = read_scan(path, None)
    measured = measured_part(given)
    assert (measured.unmeasured, measured.warnings) == ((), ())
    assert far_apart(given.heights * (given.um_per_unit or 1e-3)) is None


# --- files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "shape", "holes"),
    [
        ("di_stopped_zeros.001", (70, 128), 0),
        ("n_sentinel_-9999.npy", (58, 64), 0),
        ("i_f32_gdal_nodata.tif", (58, 64), 0),
        ("t_esri_noheader.txt", (58, 64), 0),
        ("nanonis_unfinished_45.sxm", (35, 64), 0),
        ("g_mask_void.gwy", (64, 64), 256),
    ],
)
def test_files_of_the_field(name: str, shape: tuple[int, int], holes: int) -> None:
    path = shared_file(f"field/{name}")
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    given = read_scan(path, None)
    missing = {"pitch_um": 0.15625} if given.pitch_um is None else {}
    unit = {"height_unit": "nm"} if given.um_per_unit is None else {}
    field, record = load_scan(SurfaceSource(path=str(path), **missing, **unit))  # type: ignore[arg-type]
    assert (record.shape, record.holes) == (shape, holes)
    assert any("was not measured" in warning for warning in record.warnings)
    # what is left is the surface: 50 nm high
    assert np.nanmax(field.heights_um) - np.nanmin(field.heights_um) < 0.15


def test_a_scan_of_which_little_is_left_is_refused(tmp_path: Path) -> None:
    heights = skin()
    heights[5:] = 0.0
    np.save(tmp_path / "stopped.npy", heights)
    # five rows are too few to tell zeros from a mirror
    _, record = load_scan(SurfaceSource(path=str(tmp_path / "stopped.npy"), pitch_um=0.1, height_unit="nm"))
    assert record.unmeasured == ()
    heights[5:] = np.nan
    np.save(tmp_path / "stopped.npy", heights)
    with pytest.raises(InputError, match="5 x 60"):
        load_scan(SurfaceSource(path=str(tmp_path / "stopped.npy"), pitch_um=0.1, height_unit="nm"))


@pytest.mark.parametrize(("use", "holes", "told"), [(None, 0, True), ("ignore", 0, False), ("holes", 96, True)])
def test_the_mask_of_a_gwyddion_file(tmp_path: Path, use: Any, holes: int, told: bool) -> None:
    gwyfile = pytest.importorskip("gwyfile")
    from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit

    metres = GwySIUnit(unitstr="m")
    covered = np.zeros((NY, NX))
    # stored with the top row first
    covered[:8, 10:22] = 1.0
    field = GwyDataField(1e-9 * skin()[::-1], xreal=6e-6, yreal=7.2e-6, si_unit_xy=metres, si_unit_z=metres)
    content = GwyContainer({"/0/data": field, "/0/data/title": "Height", "/0/mask": GwyDataField(covered)})
    path = tmp_path / "masked.gwy"
    content.tofile(str(path))
    assert gwyfile.load(str(path))["/0/mask"] is not None
    heights, record = load_scan(SurfaceSource(path=str(path), mask=use))
    assert (record.holes, record.masked_share) == (holes, 96 / (NY * NX))
    assert bool(record.warnings) == told
    assert np.isnan(heights.heights_um[-8:, 10:22]).all() == (holes > 0)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 1.0])
def test_a_sample_without_holes_is_that_of_the_rest(share: float) -> None:
    """Of more values than are sampled, so that steps are longer than one."""
    rng = np.random.default_rng(3)
    values = rng.standard_normal((700, 900))
    excluded = rng.random(values.shape) < share
    np.testing.assert_array_equal(sample_without(values, excluded), sample(values[~excluded]))


def test_a_scan_stays_as_it_was_read() -> None:
    heights = skin()
    heights[:10] = 0.0
    read_so = heights.copy()
    assert measured_part(scan(heights)).cropped[0] == 10
    np.testing.assert_array_equal(heights, read_so)
