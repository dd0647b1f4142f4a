"""Arrays on disk: zarr 3 groups with named axes, units and checksums, as xarray opens them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# chunks are the units of reading: zarr's overhead dominates smaller ones. Shards are the files, and are assembled in
# memory: larger ones cost more time than fewer files save
_CHUNK_BYTES = 2**22
_SHARD_BYTES = 2**23
# measured with zarr 3.1 on arrays of 8 to 400 MiB
_SHARDS_IN_FLIGHT = 17
# read at once: whole shards, which zarr reads several of at the same time
_READ_BYTES = 2**26
_LINE_BYTES = 64


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
    import zarr
    from zarr.codecs import Crc32cCodec

    group = zarr.create_group(folder, attributes=dict(attributes))
    for name, array in arrays.items():
        chunk, shard = _tiling(array.values)
        group.create_array(
            name,
            data=np.ascontiguousarray(array.values),
            chunks=chunk,
            shards=shard,
            compressors=[Crc32cCodec()],
            dimension_names=array.axes,
            attributes={"units": array.unit, **array.attributes},
        )


def saving_bytes(nbytes: int) -> int:
    """Computes the memory in which `save` works, bytes, from the size of its largest array: shards in flight, twice.

    zarr writes at most _SHARDS_IN_FLIGHT shards at once, each assembled from its chunks.
    """
    return min(2 * nbytes, _SHARDS_IN_FLIGHT * _SHARD_BYTES)


def loading_bytes(nbytes: int) -> int:
    """Computes the memory in which `load` works, bytes: the array, and a part with its chunks as they were read."""
    return nbytes + 2 * min(nbytes, _READ_BYTES)


def load(folder: Path, name: str) -> NDArray[Any]:
    """Reads one array of a group into memory, from a cache line on: a device that shares it needs no copy."""
    import zarr

    stored = zarr.open_array(folder / name, mode="r")
    values = _on_a_cache_line(stored.shape, stored.dtype)
    row = max(1, values.nbytes // max(1, len(values)))
    at_once = max(1, _READ_BYTES // row)
    at_once = max(1, at_once // stored.shards[0]) * stored.shards[0] if stored.shards else at_once
    for first in range(0, len(values), at_once):
        values[first : first + at_once] = stored[first : first + at_once]
    return values


def _on_a_cache_line(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Returns an uninitialised array that begins on a cache line."""
    nbytes = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
    raw = np.empty(nbytes + _LINE_BYTES, np.uint8)
    first = -raw.ctypes.data % _LINE_BYTES
    return raw[first : first + nbytes].view(dtype).reshape(shape)


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
