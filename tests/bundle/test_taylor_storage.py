"""The paper's tables in half floats: scales, the added error, and refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from pipeline.bundle.taylor import storage
from pipeline.bundle.taylor.layout import TaylorLoss
from pipeline.bundle.verify import open_bundle, verify
from pipeline.errors import AccuracyError
from pipeline.optics.colour import delta_e
from pipeline.scene.pairs import random_pairs
from pipeline.stages.taylor import table as taylor_table
from pipeline.tables.evaluate import table_evaluator
from pipeline.tables.taylor.table import TaylorTable

from .conftest import Baker, publish, small
from .test_publish import manifest_of

HALF = {"precision": "half"}


@pytest.fixture(scope="module")
def table(bake: Baker) -> TaylorTable:
    return taylor_table.load(bake(small())["table"])


def test_scales_are_powers_of_two_that_fill_the_range_of_half_floats(table: TaylorTable) -> None:
    scale = storage.scales(table, "half")
    mantissa, _ = np.frexp(scale)
    assert np.all(mantissa == 0.5)
    peak = np.abs(table.values).max(axis=(0, 1, 2)) / scale
    # this surface is symmetric, so planes of odd p hold only rounding errors
    vanishing = scale == 2.0**-126
    assert np.all((peak == 0.0) | vanishing | ((peak >= 2.0**14) & (peak < 2.0**15)))
    assert np.mean(vanishing) < 0.5


def test_an_empty_or_vanishing_plane_has_a_scale(table: TaylorTable) -> None:
    for value in (0.0, 1e-44):
        values = np.full_like(table.values, value)
        scale = storage.scales(replace(table, values=values), "half")
        assert np.all(np.isfinite(values / scale.astype(np.float32)))


def test_float_is_stored_as_it_is(table: TaylorTable) -> None:
    assert np.all(storage.scales(table, "float") == 1.0)


def test_half_floats_keep_eleven_bits(table: TaylorTable) -> None:
    scale = storage.scales(table, "half")
    error = np.abs(storage.in_half(table, scale).values - table.values)
    assert np.all(error <= np.maximum(2.0**-11 * np.abs(table.values), 2.0**-25 * scale))


def test_a_half_bundle_has_the_error_that_it_states(bake: Baker, tmp_path: Path) -> None:
    config = small(publish=HALF)
    inputs = bake(config)
    folder = publish(config, inputs, tmp_path)
    assert verify(folder) == []
    manifest = manifest_of(folder)
    with OpenEXR.File(str(folder / manifest.tables[0].file), separate_channels=True) as file:
        assert {channel.pixels.dtype for channel in file.channels().values()} == {np.dtype(np.float16)}
    wi, wr = random_pairs(None, 2000, storage._SEED)
    exact = table_evaluator(taylor_table.load(inputs["table"]), config.radiometry)
    evaluate = open_bundle(folder).xyz
    mirrored = wi * [-1.0, -1.0, 1.0]
    loss = manifest.storage_loss
    assert isinstance(loss, TaylorLoss)
    unit = config.radiometry.unit
    worst = max(delta_e(evaluate(wi, r) / unit, exact(wi, r) / unit, 7500.0).max() for r in (wr, mirrored))
    assert loss.largest_delta_e == pytest.approx(worst)
    mirror = np.abs(evaluate(wi, mirrored)[:, 1] / exact(wi, mirrored)[:, 1] - 1.0)
    assert loss.relative_error_of_y["mirror"].maximum == pytest.approx(mirror.max(), rel=1e-6)
    assert all(0.0 <= (entry.half_subnormal_share or 0.0) < 1.0 for entry in manifest.tables)


def test_a_series_whose_terms_cancel_is_refused(bake: Baker, tmp_path: Path) -> None:
    deep = {"recipe": {"kind": "blazed", "height_um": 0.4, "size_um": 16.0, "pitch_um": 0.1}}
    config = small(surface=deep, table={"tolerance": 0.1}, publish=HALF)
    with pytest.raises(AccuracyError, match=r'terms cancel.* % .*Set publish\.precision = "float"'):
        publish(config, bake(config), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_without_mirror_directions_is_measured(bake: Baker, tmp_path: Path) -> None:
    scene = {"lights": [{"theta_deg": 60.0}], "views": {"theta_max_deg": 20.0}}
    config = small(scene=scene, render={"lights": scene["lights"]}, publish=HALF)
    loss = manifest_of(publish(config, bake(config), tmp_path)).storage_loss
    assert isinstance(loss, TaylorLoss)
    assert set(loss.relative_error_of_y) == {"random"}
