"""The transfer of a DFT stack to the device."""

from kernels import windowed_dft
from pipeline.diffraction.device import require_device
from pipeline.diffraction.dft_stack import Stack
from pipeline.optics.coherence import sigma_f


def upload(built: Stack) -> windowed_dft.DeviceStack:
    """Copies a stack to the default device. Raises DeviceError if no device works."""
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
