"""Arrays on disk: zarr 3 groups with named axes, units and checksums, as xarray opens them.

zarr reads them. They are written here, as the specification of zarr 3 and of its codec "sharding_indexed" says: the
import of zarr takes longer than writing the arrays of a bake, whose stages hand them to each other in memory.
"""

import json
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import on_a_cache_line

# chunks are the units of reading: zarr's overhead dominates smaller ones. Shards are the files
_CHUNK_BYTES = 2**22
_SHARD_BYTES = 2**23
# read at once: whole shards, which zarr reads several of at the same time
_READ_BYTES = 2**26


@dataclass(frozen=True)
class Named:
    """An array with the names of its axes (at least one) and its unit ("1" for dimensionless values)."""

    values: NDArray[Any]
    axes: tuple[str, ...]
    unit: str
    attributes: dict[str, Any] = field(default_factory=dict)


def save(folder: Path, arrays: Mapping[str, Named], attributes: Mapping[str, Any]) -> None:
    """Writes a zarr group whose chunks carry a CRC-32C.

    folder: of the group. arrays: by name. attributes: of the group, as JSON.
    """
    _describe(folder, {"attributes": dict(attributes), "zarr_format": 3, "node_type": "group"})
    for name, array in arrays.items():
        chunk, shard = _tiling(array.values)
        _describe(folder / name, _metadata(array, chunk, shard))
        values = np.ascontiguousarray(array.values)
        write = partial(_write_shard, folder / name, values, chunk, shard)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(write, range(-(-len(values) // shard[0]) if values.size else 0)))


def _describe(folder: Path, metadata: Mapping[str, Any]) -> None:
    folder.mkdir(parents=True)
    (folder / "zarr.json").write_text(json.dumps(metadata, indent=2), encoding="utf-8")


def _metadata(array: Named, chunk: tuple[int, ...], shard: tuple[int, ...]) -> dict[str, Any]:
    """Describes an array for its zarr.json."""
    dtype = array.values.dtype
    as_bytes = {"name": "bytes", **({"configuration": {"endian": "little"}} if dtype.itemsize > 1 else {})}
    index_codecs = [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}]
    sharding = {
        "chunk_shape": chunk,
        "codecs": [as_bytes, {"name": "crc32c"}],
        "index_codecs": index_codecs,
        "index_location": "end",
    }
    return {
        "shape": array.values.shape,
        "data_type": dtype.name,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shard}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": {"b": False, "c": [0.0, 0.0], "f": 0.0}.get(dtype.kind, 0),
        "codecs": [{"name": "sharding_indexed", "configuration": sharding}],
        "attributes": {"units": array.unit, **array.attributes},
        "dimension_names": array.axes,
        "zarr_format": 3,
        "node_type": "array",
        "storage_transformers": [],
    }


def _write_shard(
    folder: Path, values: NDArray[Any], chunk: tuple[int, ...], shard: tuple[int, ...], number: int
) -> None:
    """Writes one shard: its chunks, each with its CRC-32C, and the index of their places with its own."""
    first = number * shard[0]
    index = np.full((shard[0] // chunk[0], 2), np.iinfo(np.uint64).max, "<u8")
    path = folder.joinpath("c", str(number), *("0" for _ in shard[1:]))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        for i, row in enumerate(range(first, min(first + shard[0], len(values)), chunk[0])):
            rows = values[row : row + chunk[0]]
            # chunks are whole: the last one ends in zeros
            missing = chunk[0] - len(rows)
            if missing:
                rows = np.concatenate([rows, np.zeros((missing, *rows.shape[1:]), rows.dtype)])
            data = rows.astype(rows.dtype.newbyteorder("<"), copy=False).tobytes()
            index[i] = file.tell(), len(data) + 4
            file.write(data)
            file.write(_checksum(data))
        file.write(index.tobytes())
        file.write(_checksum(index.tobytes()))


def _checksum(data: bytes) -> bytes:
    return int(google_crc32c.value(data)).to_bytes(4, "little")


def saving_bytes(nbytes: int) -> int:
    """Computes the memory in which `save` works, bytes, from that of its largest array: two chunks of each thread."""
    return min(nbytes, 2 * _CHUNK_BYTES * (os.cpu_count() or 1))


def loading_bytes(nbytes: int) -> int:
    """Computes the memory in which `load` works, bytes: the array, and a part with its chunks as they were read."""
    return nbytes + 2 * min(nbytes, _READ_BYTES)


def load(folder: Path, name: str) -> NDArray[Any]:
    """Reads one array of a group into memory, from a cache line on: a device that shares it needs no copy."""
    import zarr

    stored = zarr.open_array(folder / name, mode="r")
    values = on_a_cache_line(stored.shape, stored.dtype)
    row = max(1, values.nbytes // max(1, len(values)))
    at_once = max(1, _READ_BYTES // row)
    at_once = max(1, at_once // stored.shards[0]) * stored.shards[0] if stored.shards else at_once
    for first in range(0, len(values), at_once):
        values[first : first + at_once] = stored[first : first + at_once]
    return values


def attributes(folder: Path) -> dict[str, Any]:
    """Reads the attributes of a group."""
    import zarr

    return dict(zarr.open_group(folder, mode="r").attrs)


def _tiling(values: NDArray[Any]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Chooses the shapes of chunks and shards: whole trailing axes, and as many rows of the first axis as fit."""
    shape = tuple(max(1, n) for n in values.shape)
    row = max(1, values.nbytes // shape[0])
    chunk_rows = min(shape[0], max(1, _CHUNK_BYTES // row))
    chunks_in_shard = max(1, min(_SHARD_BYTES // (row * chunk_rows), -(-shape[0] // chunk_rows)))
    return (chunk_rows, *shape[1:]), (chunk_rows * chunks_in_shard, *shape[1:])
