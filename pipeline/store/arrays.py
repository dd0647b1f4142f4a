"""Arrays on disk: zarr 3 groups with named axes, units and checksums, as xarray opens them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# a chunk is what one read fetches: smaller ones cost zarr more time than their bytes; a shard is what one file holds
# and what is put together in memory: larger ones cost more time than the files they save
_CHUNK_BYTES = 2**22
_SHARD_BYTES = 2**23


@dataclass(frozen=True)
class Named:
    """An array of one axis or more, with the axes' names and its unit ("1" where it has none)."""

    values: NDArray[Any]
    axes: tuple[str, ...]
    unit: str
    attributes: dict[str, Any] = field(default_factory=dict)


def save(folder: Path, arrays: Mapping[str, Named], attributes: Mapping[str, Any]) -> None:
    """Writes a zarr group of named arrays; every chunk carries a CRC-32C."""
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


def load(folder: Path, name: str) -> NDArray[Any]:
    """One array of a group, whole."""
    import zarr

    return np.asarray(zarr.open_group(folder, mode="r")[name])


def attributes(folder: Path) -> dict[str, Any]:
    """The attributes of a group."""
    import zarr

    return dict(zarr.open_group(folder, mode="r").attrs)


def _tiling(values: NDArray[Any]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Chunk and shard shapes: whole trailing axes, so many leading rows as fit."""
    shape = tuple(max(1, n) for n in values.shape)
    row = max(1, values.nbytes // shape[0])
    chunk_rows = min(shape[0], max(1, _CHUNK_BYTES // row))
    chunks_in_shard = max(1, min(_SHARD_BYTES // (row * chunk_rows), -(-shape[0] // chunk_rows)))
    return (chunk_rows, *shape[1:]), (chunk_rows * chunks_in_shard, *shape[1:])
