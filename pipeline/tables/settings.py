"""The base of the settings of a table: what the stages of every layout ask of a config's section [table]."""

from typing import ClassVar

from pipeline.optics.light import FINE_STEP_NM
from pipeline.validated import Validated


class LayoutSettings(Validated):
    """The keys of a section [table]. Each layout has a class of its own, with its name as a literal `layout`.

    averages_windows: whether |P|^2 is the mean over all windows of the scan.
    holds_metals: whether a metal's reflectance is part of the table.
    compresses: whether a bundle may hold the table in fewer textures.
    """

    averages_windows: ClassVar[bool] = False
    holds_metals: ClassVar[bool] = False
    compresses: ClassVar[bool] = False

    layout: str

    @property
    def integral_step_nm(self) -> float | None:
        """Step of the spectral integral, nm; None where it has no single one."""
        return None

    @property
    def mean_step_nm(self) -> float:
        """Step of the means over wavelength that are taken outside the spectral integral, nm."""
        return FINE_STEP_NM

    @property
    def holds_wavelengths(self) -> bool:
        """Whether the layout's transform gives |P|^2 of single wavelengths."""
        return False
