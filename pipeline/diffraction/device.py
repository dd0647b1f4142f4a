"""Whether there is a device to compute on, told as this project tells faults."""

from kernels import device
from pipeline.errors import DeviceError


def require_device() -> None:
    """Raises DeviceError, with what was tried and the remedy, where no device works."""
    try:
        device.default_device()
    except device.NoDeviceError as error:
        raise DeviceError(str(error)) from None
