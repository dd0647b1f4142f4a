"""The check that a device works, whose failure is one of the project's errors."""

from kernels import device
from pipeline.errors import DeviceError


def require_device() -> None:
    """Raises DeviceError if no device works; its message names the attempts and the remedy."""
    try:
        device.default_device()
    except device.NoDeviceError as error:
        raise DeviceError(str(error)) from None
