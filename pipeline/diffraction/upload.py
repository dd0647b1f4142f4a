"""From a stack in memory to one on the device, faults told as this project tells them."""

from kernels import source, windowed_dft
from pipeline.diffraction.device import require_device
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f
from pipeline.store import digest


def upload(built: Stack) -> windowed_dft.DeviceStack:
    """The stack on the default device. Raises DeviceError where none works."""
    require_device()
    return windowed_dft.upload_stack(
        built.coefficients,
        (built.row_zero, built.column_zero),
        built.spacing_per_um,
        built.reach,
        sigma_f(built.sigma_um),
        built.half_range_um,
        built.band_per_um,
    )


def kernel_digest(*names: str) -> str:
    """Return the digest of kernels' sources, by their files' names, with what these include."""
    return digest.of_json(source.text(*names))
