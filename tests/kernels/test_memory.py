"""Arrays for kernels: aligned, and on memory that served before, never on memory still in use."""

import gc

import numpy as np
import pytest

from kernels import device
from kernels.memory import MOST_SPARE_BYTES, MemoryPool


def test_arrays_begin_on_cache_lines():
    for shape in ((3,), (1000, 7), (1, 4)):
        array = device.empty(shape, np.float32)
        assert array.shape == shape
        assert array.ctypes.data % 64 == 0


def test_memory_serves_again_once_nothing_refers_to_it():
    array = device.empty((1 << 20,), np.float64)
    place = array.ctypes.data
    view = array[5:9].reshape(2, 2)
    del array
    gc.collect()
    assert device.empty((1 << 20,), np.float64).ctypes.data != place, "a view is left"
    view[...] = 1.0
    del view
    gc.collect()
    # more than the pool holds: whatever other tests left in it is taken too
    taken = [device.empty((1 << 20,), np.float64) for _ in range(40)]
    assert place in {array.ctypes.data for array in taken}


def test_memory_larger_than_the_pool_serves_again_while_it_is_kept():
    pool = MemoryPool()

    with pool.keeping():
        first = pool.empty((MOST_SPARE_BYTES + 64,), np.uint8)
        place = first.ctypes.data
        del first
        assert pool.empty((MOST_SPARE_BYTES + 64,), np.uint8).ctypes.data == place
    assert not pool.spare_bytes


def test_two_arrays_never_share():
    arrays = [device.empty((4096,), np.float32) for _ in range(20)]
    for i, array in enumerate(arrays):
        array[...] = i
    assert all(np.all(array == i) for i, array in enumerate(arrays))


def test_what_is_lent_holds_the_array():
    """A part with gaps begins on a cache line, too, where the whole does: it is copied."""
    array = device.empty((4, 32), np.float32)
    array[...] = np.arange(128).reshape(4, 32)
    for part in (array, array[:, :16]):
        found = device.download(device.lent(part), np.empty(part.shape, np.float32))
        np.testing.assert_array_equal(found, part)


def test_memory_that_cannot_be_had_leaves_nothing_to_delete(recwarn):
    """An object that was never made would be deleted with a traceback on stderr."""
    with pytest.raises(MemoryError):
        device.empty((1 << 50,), np.float32)
    gc.collect()
    assert list(recwarn) == []
