"""The origin of an artifact: versions and device, recorded with the artifact but not part of its address."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

_LIBRARIES = ("numpy", "scipy", "pyFFTW", "pyopencl", "zarr", "OpenEXR", "colour-science")


@cache
def versions() -> dict[str, str]:
    """Returns the versions of this tool, Python and the libraries that compute, by name."""
    found = {"python": platform.python_version()}
    for name in ("diffract-bake", *_LIBRARIES):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def device() -> dict[str, str]:
    """Returns the name and the driver of the OpenCL device in use.

    They are recorded because the last bits differ between devices, which contract multiply-adds differently.
    """
    from kernels.device import default_device

    used = default_device()
    return {"device": used.name, "driver": used.driver}
