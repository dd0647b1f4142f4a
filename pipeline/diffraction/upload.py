"""From a stack in memory to one on the device, faults told as this project tells them."""

from kernels import diffraction
from pipeline.diffraction.device import require_device
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f


def upload(built: Stack) -> diffraction.DeviceStack:
    """The stack on the default device. Raises DeviceError where none works."""
    require_device()
    return diffraction.upload_stack(
        built.coefficients,
        (built.row_zero, built.column_zero),
        built.spacing_per_um,
        built.reach,
        sigma_f(built.sigma_um),
        built.half_range_um,
        built.band_per_um,
    )
