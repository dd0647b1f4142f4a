"""What made an artifact: versions and device, told with the artifact, never part of its address."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

_LIBRARIES = ("numpy", "scipy", "pyFFTW", "pyopencl", "zarr", "OpenEXR", "colour-science")


@cache
def versions() -> dict[str, str]:
    """Versions of this tool, Python and the libraries that touch the numbers."""
    found = {"python": platform.python_version()}
    for name in ("diffract-bake", *_LIBRARIES):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def device() -> dict[str, str]:
    """The OpenCL device in use: kernels contract multiply-adds as it likes, so bits differ between devices."""
    from kernels.device import default_device

    used = default_device()
    return {"device": used.name, "driver": used.driver}
