"""The check that a device works, whose failure is one of the project's errors; and the device's memory."""

from contextlib import AbstractContextManager

from kernels import device
from pipeline.errors import DeviceError, StorageError


def require_device() -> None:
    """Raises DeviceError if no device works, with the attempts and the remedy; StorageError if its disk is full."""
    try:
        device.default_device()
    except OSError as error:
        raise StorageError(
            f"{error.filename}: no space left for compiled kernels; free some, or set XDG_CACHE_HOME to another place"
        ) from None
    except device.NoDeviceError as error:
        raise DeviceError(str(error)) from None


def keeping_memory() -> AbstractContextManager[None]:
    """Keeps all memory of arrays for the device while this lasts, for parts of a work that take the same in turn."""
    require_device()
    return device.default_device().memory.keeping()
