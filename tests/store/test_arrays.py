"""Arrays on disk: what was written comes back, with names and units, and not when a bit has flipped."""

import json

import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from zarr.codecs import Crc32cCodec

from pipeline.store import arrays

DTYPES = [np.bool_, np.uint8, np.int64, np.float32, np.float64, np.complex64, np.complex128]


def save_one(folder, values, axes=None, unit="um", **attributes):
    names = tuple("abcdefgh"[: values.ndim]) if axes is None else axes
    arrays.save(folder, {"field": arrays.Named(values, names, unit, attributes)}, {"kept": [1, 2.5, "x"]})


@settings(max_examples=60, deadline=None)
@given(
    values=st.sampled_from(DTYPES).flatmap(
        lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=1, max_dims=4, min_side=0, max_side=9))
    )
)
def test_round_trip(tmp_path_factory, values):
    """Every value, NaN included, of every shape and type comes back as it was."""
    folder = tmp_path_factory.mktemp("round") / "a.zarr"
    save_one(folder, values)
    found = arrays.load(folder, "field")
    assert (found.shape, found.dtype) == (values.shape, values.dtype)
    np.testing.assert_array_equal(found, values)
    assert arrays.attributes(folder) == {"kept": [1, 2.5, "x"]}


@pytest.mark.parametrize(
    "shape", [(1,), (1, 1, 1), (300_001,), (3, 700_000), (4099, 513), (2, 3, 100, 700), (5, 1_300_000)]
)
def test_round_trip_over_several_chunks(tmp_path, shape):
    """Shapes that fill no whole number of chunks or shards."""
    values = np.random.default_rng(1).random(shape, dtype=np.float32)
    save_one(tmp_path / "a.zarr", values)
    np.testing.assert_array_equal(arrays.load(tmp_path / "a.zarr", "field"), values)


@pytest.mark.parametrize("order", ["F", "strided"])
def test_round_trip_of_any_memory_layout(tmp_path, order):
    """Indices count, not the layout in memory."""
    values = np.arange(60.0).reshape(6, 10)
    values = np.asfortranarray(values) if order == "F" else values[::-2, 1::3]
    save_one(tmp_path / "a.zarr", values)
    np.testing.assert_array_equal(arrays.load(tmp_path / "a.zarr", "field"), values)


def test_names_and_units_are_plain_zarr_3_metadata(tmp_path):
    """Other readers find the axes' names in zarr.json and the unit among its attributes."""
    arrays.save(
        tmp_path / "a.zarr",
        {
            "height": arrays.Named(np.zeros((2, 3)), ("y", "x"), "um", {"long_name": "height"}),
            "x": arrays.Named(np.zeros(3), ("x",), "1/um"),
        },
        {"pitch_um": [0.1, 0.2]},
    )
    group = json.loads((tmp_path / "a.zarr/zarr.json").read_text())
    height = json.loads((tmp_path / "a.zarr/height/zarr.json").read_text())
    x = json.loads((tmp_path / "a.zarr/x/zarr.json").read_text())
    assert (group["zarr_format"], group["node_type"]) == (3, "group")
    assert group["attributes"] == {"pitch_um": [0.1, 0.2]}
    assert (height["zarr_format"], height["shape"]) == (3, [2, 3])
    assert height["dimension_names"] == ["y", "x"]
    assert height["attributes"] == {"units": "um", "long_name": "height"}
    assert (x["dimension_names"], x["attributes"]) == (["x"], {"units": "1/um"})


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(3, 0), (300_001,), (4, 700_000)], ids=str)
def test_files_are_those_that_zarr_writes(tmp_path, dtype, shape):
    """Chunks, indices and descriptions are zarr's own, byte by byte."""
    values = (100 * np.random.default_rng(1).random(shape) + 1).astype(dtype)
    save_one(tmp_path / "a.zarr", values)
    stored = zarr.open_array(tmp_path / "a.zarr/field")
    zarr.create_group(tmp_path / "b.zarr", attributes={"kept": [1, 2.5, "x"]}).create_array(
        "field",
        data=values,
        chunks=stored.chunks,
        shards=stored.shards,
        compressors=[Crc32cCodec()],
        dimension_names=stored.metadata.dimension_names,
        attributes={"units": "um"},
    )
    ours, zarrs = ({p.relative_to(root): p for p in root.rglob("*")} for root in sorted(tmp_path.iterdir()))
    assert ours.keys() == zarrs.keys()
    assert all(ours[p].read_bytes() == zarrs[p].read_bytes() for p in ours if ours[p].is_file())


def test_one_file_holds_many_chunks(tmp_path):
    """Arrays are sharded: 8 MiB are one file, in chunks that are read on their own."""
    save_one(tmp_path / "a.zarr", np.ones((1024, 1024)))
    stored = json.loads((tmp_path / "a.zarr/field/zarr.json").read_text())
    (sharding,) = stored["codecs"]
    inner = sharding["configuration"]["chunk_shape"]
    assert sharding["name"] == "sharding_indexed"
    assert 8 * np.prod(inner) <= 2**22
    assert len(shards(tmp_path / "a.zarr")) == 1


def shards(folder):
    return [path for path in folder.rglob("*") if path.is_file() and path.name != "zarr.json"]


@settings(max_examples=25, deadline=None)
@given(place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_found_on_reading(tmp_path_factory, place, bit):
    """Every byte of a shard, its index too, is under a checksum: none can change unseen."""
    folder = tmp_path_factory.mktemp("flip") / "a.zarr"
    save_one(folder, np.random.default_rng(2).random((300, 600)))
    (shard,) = shards(folder)
    data = bytearray(shard.read_bytes())
    data[int(place * len(data))] ^= 1 << bit
    shard.write_bytes(data)
    with pytest.raises(ValueError, match=r"(?i)checksum|crc"):
        arrays.load(folder, "field")
