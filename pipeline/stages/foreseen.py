"""The values from which memory and time of the stages are computed before they begin."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import floor, log10

from kernels.memory import MOST_SPARE_BYTES
from pipeline.config.models import Config
from pipeline.diffraction import reference
from pipeline.optics.light import FINE_STEP_NM
from pipeline.resources import MIB, Arrays, Need
from pipeline.stages.session import kept_bytes
from pipeline.stages.stage import Summary
from pipeline.store.arrays import loading_bytes, saving_bytes
from pipeline.surface import windows
from pipeline.surface.extent import Extent

# an interpreter with what each stage imports, the driver and its compiler. Measured with Python 3.11 and PoCL 3.1 on
# a grating of 100 x 100 samples, in a process that compiles the kernels; another needs 145 MiB less
_BASE_BYTES = {
    "surface": 300 * MIB,
    "table": 330 * MIB,
    "textures": 335 * MIB,
    "render": 335 * MIB,
    "validate": 400 * MIB,
    "bundle": 390 * MIB,
}


@dataclass(frozen=True)
class Foreseen:
    """A bake before its stages begin.

    config: the config. extent: samples and heights of its surface. made: summaries of the stages that are made.
    """

    config: Config
    extent: Extent
    made: Mapping[str, Summary]

    @property
    def places(self) -> windows.Places:
        """Positions of the coherence window."""
        if not self.config.table.averages_windows:
            return windows.MIDDLE
        return windows.places(self.extent, self.config.coherence)

    @property
    def wavelengths(self) -> int:
        """Number of wavelengths of the exact reference."""
        light = self.config.light
        return 1 if light.is_line else round((light.range_nm[1] - light.range_nm[0]) / FINE_STEP_NM) + 1

    @cached_property
    def reference(self) -> reference.ReferenceSize:
        """Size of the exact reference."""
        sigma_um, lambda_min_nm = self.config.coherence.sigma_um, self.config.light.lambda_min_nm
        return reference.size(self.extent, sigma_um, lambda_min_nm, self.places)

    def reading(self, **objects: int) -> Arrays:
        """Lists what the first stage of several holds while it reads objects that the session did not keep."""
        return {
            f"reading of the {name}": loading_bytes(size) for name, size in objects.items() if not kept_bytes(size)
        }

    def held(self, **objects: int) -> Arrays:
        """Lists what the session holds between stages: of objects by size in bytes, those that are kept."""
        height_field = kept_bytes(self.extent.bytes)
        return {"height field": height_field, **{name: kept_bytes(size) for name, size in objects.items()}}


@dataclass(frozen=True)
class LayoutSizes:
    """Memory and time that the stages of a layout need.

    transform, table: of these stages. transform_bytes: of the transform, if the session holds it. written_bytes: of
    the transform as an artifact.
    table_bytes: of the table. freed_bytes: of arrays of both stages that the device's pool may keep.
    textures: of this stage, in addition to the table. stored_bytes: of the textures, 0 where they are the table.
    delta_e: mean CIELAB error expected of the table; None where nothing is known of it.
    study: of the curves of `validate`, in addition to the table. prepared: of a bundle's images, likewise.
    kept_share: computes the share of the table's texels that a bundle holds.
    """

    transform: Need
    table: Need
    transform_bytes: int
    table_bytes: int
    freed_bytes: int
    textures: Need
    stored_bytes: int
    study: Need
    prepared: Need
    written_bytes: int = 0
    delta_e: float | None = None
    kept_share: Callable[[], float] = lambda: 1.0


@dataclass(frozen=True)
class WayOut:
    """A key that a refusal may propose to change, and the end of its range towards less work.

    rises: whether larger values are less work. multiple: of which the key's whole number has to be, None for a real
    number. odd: whether it is one above such a multiple.
    """

    key: str
    end: float
    rises: bool = False
    multiple: int | None = None
    odd: bool = False

    def rounded(self, number: float, towards: float) -> float:
        """Rounds to two digits, or to what the key may be, towards another number."""
        if self.multiple is not None:
            return float(max(1, int(number) // self.multiple) * self.multiple + self.odd)
        digit = 10.0 ** (floor(log10(number)) - 1)
        return float(f"{round(number / digit) * digit:.3g}") if number != towards else number


def process(nbytes: int) -> Arrays:
    """Returns the memory of the process itself, as an array of this size."""
    return {"interpreter, driver, kernels": nbytes}


def base(stage: str) -> Arrays:
    """Returns the memory of the process itself in a stage that is common to all layouts."""
    return process(_BASE_BYTES[stage])


def spare(*freed: int) -> Arrays:
    """Returns the memory that the device's pool keeps of arrays that were freed."""
    return {"memory to be used again": min(MOST_SPARE_BYTES, sum(freed))}


def heap(*written: int) -> Arrays:
    """Returns the memory that the threads which wrote arrays keep: their blocks are too small to be given back."""
    return {"heaps of threads": saving_bytes(max(written))}
